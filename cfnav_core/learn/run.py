"""State of one training run: networks, optimizers, checkpoints, validation, log."""

from __future__ import annotations

import math
import shutil
import time
from copy import deepcopy
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import torch

from cfnav_core.agent.agent import new_agent
from cfnav_core.agent.collision_predictor import CollisionPredictor
from cfnav_core.agent.config import TrainOptions
from cfnav_core.agent.find import find_method
from cfnav_core.agent.methods import Stage
from cfnav_core.files.checkpoint import (
    load_module,
    load_tensors,
    optimizer_tensors,
    restore_optimizer,
    save_tensors,
)
from cfnav_core.files.provenance import commit, sha256
from cfnav_core.files.whole import whole, writing
from cfnav_core.knowledge.files import load_knowledge
from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Episodes, Trace, run_episodes
from cfnav_core.learn.ranks import Ranks
from cfnav_core.learn.run_files import CHECKPOINT, STAGE1
from cfnav_core.learn.run_log import RunLog
from cfnav_core.learn.same_run import check_same, check_stage1
from cfnav_core.learn.stage_one import NO_RULE, StageOne, predictor_figures, rule_of
from cfnav_core.models.base import Knowledge
from cfnav_core.policy.networks import TorchNetworks
from cfnav_core.scenes.check import not_finite
from cfnav_core.scenes.scene import SceneError
from cfnav_core.scenes.select import scene_names
from cfnav_core.task.detections import SIGHTINGS
from cfnav_core.task.metrics import cf_sr, sr

CARRIED, KEPT = "carried.", "kept_predictor"


@dataclass
class Progress:
    """Where a run is between two validations.

    Attributes:
        validated: episodes at its last validation, or where it began.
        border: stage one has just ended, and what is due then is not done yet.
        sums: of what ``Execution.round`` said since the last validation, with steps and seconds.
    """

    validated: int = 0
    border: bool = False
    sums: dict[str, float] = field(default_factory=dict)

    def add(self, figures: dict[str, float]) -> None:
        """Add to the sums."""
        for key, value in figures.items():
            self.sums[key] = self.sums.get(key, 0.0) + value


class Run:
    """State of one training run.

    Attributes:
        hp: as asked for, but its E_1 is where the rule ended stage one, before that its most.
        episodes, steps: so far, of both stages. best: highest validation CF-SR, -1 before any.
        progress: where it is between two validations.
        stage1: what is known of stage one. kept: the predictor when it last gained in a stage one
            under the rule, until that has ended.
        carried: what ``carried`` took of the run that this one goes on from; None in a new one.
        began: SHA-256 of the stage one that it was given, "" of none; None of a run before this
            was kept.

    Raises:
        SceneError: the scenes cannot be used.
        CheckpointError: an existing checkpoint belongs to another configuration.
    """

    def __init__(self, options: TrainOptions) -> None:
        options.check()
        rooms = (options.train_rooms, options.validation_rooms)
        shared = set.intersection(*(set(scene_names(options.scenes, r)) for r in rooms))
        if shared:
            raise ValueError(f"found rooms in both training and validation: {sorted(shared)}")
        config = options.run
        self.options, self.hp = options, config.hyperparameters
        self.method = find_method(config.method)
        self.rule = rule_of(options, self.method)
        if most := self.rule[0]:
            self.hp = replace(self.hp, stage1_episodes=most)
        self.ranks = Ranks.join()
        if options.workers and self.ranks.size > 1:
            raise ValueError(
                f"found {options.workers} asynchronous workers on {self.ranks.size} processes, "
                "expected one or the other; leave out --workers or torchrun"
            )
        if options.workers and options.device == "cuda":
            raise ValueError(
                f"found {options.workers} asynchronous workers on a GPU, expected them on the CPU; "
                "leave out --workers or --device"
            )
        device = self.ranks.device("cpu" if options.workers else options.device)
        leave_out, scenes = options.leave_out, options.scenes
        self.bank = SceneBank.load(scenes, options.train_rooms, device, leave_out=leave_out)
        self.validation = SceneBank.load(
            scenes, options.validation_rooms, device, leave_out=leave_out
        )
        self._check_rooms()
        self.frozen = Episodes.draw(self.validation, options.validation_episodes, seed=1)
        torch.manual_seed(config.seed)
        objects, perception = self.bank.objects, self.bank.perception
        known = options.knowledge and load_knowledge(
            options.knowledge, objects, perception, scene_names(scenes, options.train_rooms)
        )
        self.knowledge = known or Knowledge()
        self.agent = new_agent(config, self.bank.inputs, self.knowledge, device)
        self.model, self.predictor = self.agent.model, self.agent.predictor
        self.optimizer, self.predictor_optimizer = (
            torch.optim.Adam(own, self.hp.lr, fused=True) for own in self.agent.parameters()
        )
        self.episodes, self.steps, self.best = 0, 0, -1.0
        self.progress, self.stage1 = Progress(), StageOne()
        self.kept: CollisionPredictor | None = None
        self.began: str | None = ""
        self.carried: dict[str, torch.Tensor] | None = None
        self._cpu_s_before = 0.0
        self.commit = commit()  # of the code that is loaded, whatever happens to the tree later
        self.options.out.mkdir(parents=True, exist_ok=True)
        self.log = RunLog(self.options.out)

    def _check_rooms(self) -> None:
        """What validates is to be seen by the same eyes as what trains.

        Raises:
            SceneError: it is not.
        """
        of = [
            {"perception": bank.perception, "detections": bank.inputs.fields,
             "objects": bank.objects, "camera": str(bank.camera)}
            for bank in (self.bank, self.validation)
        ]  # fmt: skip
        # whoever reads sightings reads those of any camera
        ignored = {"camera", "perception"} if of[0]["detections"] == SIGHTINGS else set()
        for key in of[0].keys() - ignored:
            if of[0][key] != of[1][key]:
                raise SceneError(
                    f"found validation rooms of {key} {of[1][key]} and training rooms of "
                    f"{of[0][key]} in {self.options.scenes}; make both alike"
                )

    @property
    def cpu_s(self) -> float:
        """Processor seconds of this process and, up to its checkpoint, of those before it.

        With loading and validations; without a stage one that was given and asynchronous workers.
        """
        return self._cpu_s_before + time.process_time()

    @property
    def goals(self) -> list[str]:
        """What it asks for in training, sorted."""
        return sorted({self.bank.objects[g] for g in self.bank.tasks.goal})

    @property
    def total(self) -> int:
        """E_1 + E_2, the most it may be while stage one is under way."""
        return self.hp.stage1_episodes + self.hp.stage2_episodes

    @property
    def validation_due(self) -> bool:
        """One is every so many episodes, and one at the end, so that there is a best checkpoint."""
        validated, every = self.progress.validated, self.options.validation_every
        if self.episodes >= self.total and (self.episodes > validated or self.best < 0):
            return True
        if self.judged_stage1 and self.episodes >= self.hp.stage1_episodes:
            return True
        return self.episodes // every > validated // every

    @property
    def judged_stage1(self) -> bool:
        """Whether validations are to end stage one, and none has yet."""
        return self.rule != NO_RULE and self.stage1.ended is None

    @property
    def in_stage1(self) -> bool:
        """Alg. 1: E < E_1, or a validation is still to end it."""
        return self.judged_stage1 or self.episodes < self.hp.stage1_episodes

    def heed(self, auc: float, kept_auc: float) -> bool:
        """Take a validation's AUCs of the predictor and of the kept one, NaN for none.

        Returns:
            Whether it ends a stage one under the rule; phi is then the better one of both.
        """
        stage1 = self.stage1
        if not math.isnan(auc):
            stage1.aucs.append([self.episodes, auc])
        if not self.judged_stage1:
            return False
        most, rise, patience = self.rule
        if stage1.gains(self.episodes, auc, kept_auc, rise):
            self.kept, kept_auc = deepcopy(self.predictor), auc
        least = self.options.run.hyperparameters.stage1_episodes
        if self.episodes < most and (self.episodes < least or stage1.without_gain < patience):
            return False
        stage1.frozen = [self.episodes, auc]
        if self.kept and stage1.kept and not auc >= kept_auc:
            self.predictor.load_state_dict(self.kept.state_dict())
            stage1.frozen = [stage1.kept, kept_auc]
        self.kept = None
        self._end_stage1(self.episodes)
        return True

    def _end_stage1(self, episodes: int) -> None:
        self.stage1.ended = episodes
        self.hp = replace(self.hp, stage1_episodes=episodes)

    def resume(self) -> None:
        """Go on from the run's own checkpoint, else from a given stage one, else from nothing."""
        own = self.options.out / CHECKPOINT
        resumed = own.exists()
        source = own if resumed else self.options.stage1
        if source:
            self._load(source, own)
        if self.ranks.leads:
            self.log.go_on_from(self.progress.validated if resumed else -1)
            if self.progress.border:  # the kill may have come before
                self.keep_stage1()

    def _load(self, source: Path, own: Path) -> None:
        tensors, head = load_tensors(source)
        if head["perception"] != self.bank.perception:
            raise ValueError(
                f"found {source} trained with perception {head['perception']}, but the scenes have "
                f"{self.bank.perception}; give scenes of the same perception"
            )
        if source == own:
            check_same(self, tensors, head)
            self.began = head.get("began")
        else:
            check_stage1(self, source, tensors, head)
            self.began = sha256(source)
        load_module(source, "model", self.model, tensors)
        load_module(source, "predictor", self.predictor, tensors)
        restore_optimizer(source, "optimizer", self.optimizer, tensors)
        restore_optimizer(source, "predictor_optimizer", self.predictor_optimizer, tensors)
        self.episodes, self.steps = head["episodes"], head["steps"]
        self.stage1 = StageOne(**head.get("stage1", {}))
        if self.stage1.ended is not None:
            self._end_stage1(self.stage1.ended)
        if source != own:
            self.progress.validated = self.episodes
            return
        self.best = head["best"]
        self._cpu_s_before = head.get("cpu_s", 0.0)
        # what was saved without it, as once everything, was saved right after a validation
        self.progress = Progress(**head.get("progress", {"validated": self.episodes}))
        self.progress.border &= not self.in_stage1
        self.carried = {
            k.removeprefix(CARRIED): v for k, v in tensors.items() if k.startswith(CARRIED)
        }
        if any(k.startswith(KEPT + ".") for k in tensors):
            self.kept = deepcopy(self.predictor)
            load_module(source, KEPT, self.kept, tensors)

    def save(self, name: str, carried: dict[str, torch.Tensor] | None = None) -> None:
        """Write weights, optimizers and what the run was, where this process leads.

        Args:
            name: of the file.
            carried: what else the run goes on from; with it its progress is kept.
        """
        if not self.ranks.leads:
            return
        tensors = self.agent.tensors(self.knowledge)
        tensors |= optimizer_tensors("optimizer", self.optimizer)
        tensors |= optimizer_tensors("predictor_optimizer", self.predictor_optimizer)
        tensors |= {CARRIED + k: v for k, v in (carried or {}).items()}
        if self.kept:
            tensors |= {f"{KEPT}.{k}": v for k, v in self.kept.state_dict().items()}
        progress = {} if carried is None else {"progress": asdict(self.progress)}
        save_tensors(self.options.out / name, tensors, {
            "config": asdict(self.options.run), "episodes": self.episodes, "steps": self.steps,
            "best": self.best, "cpu_s": self.cpu_s, "stage1": asdict(self.stage1),
            "stage1_rule": self.rule,
            "perception": self.bank.perception, "goals": self.goals,
            "inputs": asdict(self.bank.inputs),
            "camera": camera.to_json() if (camera := self.bank.camera) else None,
            "commit": self.commit, "train_rooms": self.options.train_rooms,
            "validation_rooms": self.options.validation_rooms,
            "validation_episodes": self.options.validation_episodes,
            "leave_out": sorted(self.options.leave_out), "began": self.began, **progress,
        })  # fmt: skip

    def keep_stage1(self) -> None:
        """Stage one is what the checkpoint has now: others may go on from it at once.

        It is a copy, so that after a kill the same one is made again.
        """
        path = self.options.out / STAGE1
        with writing(path), whole(path) as partial:
            shutil.copyfile(self.options.out / CHECKPOINT, partial)

    def validate(self) -> dict[str, float]:
        """SR and CF-SR on the frozen validation episodes, argmax."""
        networks = TorchNetworks(self.model, self.predictor, self.stage.feed_prediction)
        results = run_episodes(networks, self.validation, self.frozen)
        return {"validation_sr": sr(results), "validation_cf_sr": cf_sr(results)}

    def judge_predictor(self) -> dict[str, float]:
        """``predictor_figures`` of the frozen validation episodes, as stage one walks them.

        Actions are drawn: the most probable ones of a young policy hardly move, or run into one
        wall for ever.

        Returns:
            These, and predictor_kept_auc of the kept predictor at the same steps.
        """
        found = self._foresight(self.predictor)
        # nobody reads what is predicted, so the same steps are taken
        kept = self._foresight(self.kept) if self.kept else {}
        if "predictor_auc" in kept:
            found["predictor_kept_auc"] = kept["predictor_auc"]
        return found

    def _foresight(self, predictor: CollisionPredictor) -> dict[str, float]:
        trace: list[Trace] = []
        networks = TorchNetworks(self.model, predictor, self.method.stage1.feed_prediction)
        run_episodes(networks, self.validation, self.frozen, sample_seed=1, trace=trace)
        return predictor_figures(self.validation, trace)

    def not_finite(self) -> str:
        """Why a gradient is no number, as a sentence."""
        for scene in self.bank.scenes:
            for key in ("features", "detections"):
                for state in not_finite(getattr(scene, key)):
                    return (
                        f"found {key} of state {state} of {scene.name} in {self.options.scenes} "
                        "that are no numbers; look at the scenes with cfnav data check, and make "
                        "that one again"
                    )
        return (
            f"found gradients that are no numbers after {self.episodes} episodes, though all that "
            "is seen are; give a smaller --lr"
        )

    @property
    def stage(self) -> Stage:
        """Alg. 1: stage one while E < E_1, stage two from then on."""
        return self.method.stage1 if self.in_stage1 else self.method.stage2
