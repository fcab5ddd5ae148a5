"""State of one training run: networks, optimizers, checkpoints, validation, log."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch.utils.tensorboard import SummaryWriter

from cfnav_core.agent import new_agent
from cfnav_core.checkpoint import (
    CheckpointError,
    load_module,
    load_tensors,
    optimizer_tensors,
    restore_optimizer,
    save_tensors,
)
from cfnav_core.config import TrainOptions
from cfnav_core.env import SceneBank
from cfnav_core.evaluate import Episodes, run_episodes
from cfnav_core.knowledge.files import load_knowledge
from cfnav_core.methods import METHODS, Stage
from cfnav_core.metrics import cf_sr, sr
from cfnav_core.models import Knowledge
from cfnav_core.networks import TorchNetworks
from cfnav_core.ranks import Ranks
from cfnav_core.run_files import CHECKPOINT, LOG
from cfnav_core.scene_check import not_finite
from cfnav_core.scenes import scene_names
from cfnav_core.source import commit
from cfnav_core.whole import write_file, writing


class Run:
    """State of one training run.

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
        self.method = METHODS[config.method]
        self.bank = SceneBank.load(options.scenes, options.train_rooms, device)
        self.validation = SceneBank.load(options.scenes, options.validation_rooms, device)
        self.frozen = Episodes.draw(self.validation, options.validation_episodes, seed=1)
        torch.manual_seed(config.seed)
        objects, perception = self.bank.objects, self.bank.perception
        known = options.knowledge and load_knowledge(options.knowledge, objects, perception)
        self.knowledge = known or Knowledge()
        self.agent = new_agent(config, self.bank.inputs, self.knowledge, device)
        self.model, self.predictor = self.agent.model, self.agent.predictor
        self.optimizer, self.predictor_optimizer = (
            torch.optim.Adam(own, self.hp.lr, fused=True) for own in self.agent.parameters()
        )
        self.episodes, self.steps, self.best = 0, 0, -1.0
        self._cpu_s_before = 0.0
        self._board: SummaryWriter | None = None
        self.commit = commit()  # of the code that is loaded, whatever happens to the tree later
        self.options.out.mkdir(parents=True, exist_ok=True)

    @property
    def cpu_s(self) -> float:
        """Processor seconds of this process and, up to its checkpoint, of those before it.

        With loading and validations; without a stage one that was given and asynchronous workers.
        """
        return self._cpu_s_before + time.process_time()

    @property
    def total(self) -> int:
        """E_1 + E_2."""
        return self.hp.stage1_episodes + self.hp.stage2_episodes

    def resume(self) -> None:
        """Go on from the run's own checkpoint, else from a given stage one, else from nothing."""
        own = self.options.out / CHECKPOINT
        source = own if own.exists() else self.options.stage1
        if source:
            self._load(source, own)
        if self.ranks.leads:
            self._forget_later_lines()

    def _load(self, source: Path, own: Path) -> None:
        tensors, head = load_tensors(source)
        if head["perception"] != self.bank.perception:
            raise ValueError(
                f"found {source} trained with perception {head['perception']}, but the scenes have "
                f"{self.bank.perception}; give scenes of the same perception"
            )
        if source == own:
            self._check_same(tensors, head)
        else:
            self._check_stage1(source, head)
        load_module(source, "model", self.model, tensors)
        load_module(source, "predictor", self.predictor, tensors)
        restore_optimizer("optimizer", self.optimizer, tensors)
        restore_optimizer("predictor_optimizer", self.predictor_optimizer, tensors)
        self.episodes, self.steps = head["episodes"], head["steps"]
        if source == own:
            self.best = head["best"]
            self._cpu_s_before = head.get("cpu_s", 0.0)

    def _check_same(self, tensors: dict[str, torch.Tensor], head: dict[str, Any]) -> None:
        """A run goes on as what it was; only its hyperparameters, such as its length, may change.

        Raises:
            CheckpointError: it was another method, model, seed or size, had other rooms, or knew
                something else.
        """
        options = self.options
        asked = asdict(options.run) | {
            "train_rooms": list(options.train_rooms),
            "validation_rooms": list(options.validation_rooms),
        }
        found = head | head["config"]
        for key, value in asked.items():
            if key != "hyperparameters" and found.get(key) != value:
                raise CheckpointError(
                    f"found a run with {key} {found.get(key)!r} in {options.out}, but "
                    f"{value!r} is asked for; choose another --out or delete it"
                )
        known = {f"knowledge.{k}": v for k, v in self.knowledge.arrays().items()}
        stored = {k: v.numpy() for k, v in tensors.items() if k.startswith("knowledge.")}
        same = known.keys() == stored.keys()
        if not same or not all(np.array_equal(known[k], stored[k]) for k in known):
            raise CheckpointError(
                f"found a run in {options.out} that knew something else of the objects than "
                f"{options.knowledge}; give its own --knowledge, or choose another --out"
            )

    def _check_stage1(self, source: Path, head: dict[str, Any]) -> None:
        """Stage one may come from a run whose stage one is this run's.

        It may also have trained a predictor that this run does not need, so that methods are
        compared from the same weights.

        Raises:
            CheckpointError: it is another stage one.
        """
        asked, found = asdict(self.options.run), head["config"]
        there = METHODS[found["method"]]
        same_rule = there.shared_encoder == self.method.shared_encoder and self.method.stage1 in (
            there.stage1, replace(there.stage1, train_predictor=False)
        )  # fmt: skip
        different = [
            key for key in asked
            if key not in ("hyperparameters", "method") and asked[key] != found.get(key)
        ] + ([] if same_rule else ["method"])  # fmt: skip
        if different:
            raise CheckpointError(
                f"found {source} of a run with {different[0]} {found.get(different[0])!r}, whose "
                f"stage one is not that of {asked[different[0]]!r}; leave out --stage1"
            )
        if head["episodes"] < self.hp.stage1_episodes:
            raise CheckpointError(
                f"found {source} after {head['episodes']} episodes, expected all "
                f"{self.hp.stage1_episodes} of stage one; let that run go on first"
            )

    def save(self, name: str) -> None:
        """Write everything the run needs to go on."""
        tensors = self.agent.tensors(self.knowledge)
        tensors |= optimizer_tensors("optimizer", self.optimizer)
        tensors |= optimizer_tensors("predictor_optimizer", self.predictor_optimizer)
        goals = sorted({self.bank.objects[g] for g in self.bank.tasks.goal})
        save_tensors(self.options.out / name, tensors, {
            "config": asdict(self.options.run), "episodes": self.episodes, "steps": self.steps,
            "best": self.best, "cpu_s": self.cpu_s,
            "perception": self.bank.perception, "goals": goals,
            "inputs": asdict(self.bank.inputs),
            "commit": self.commit, "train_rooms": self.options.train_rooms,
            "validation_rooms": self.options.validation_rooms,
        })  # fmt: skip

    def learning_rate(self) -> float:
        """Constant in stage one, falling linearly to a tenth during stage two."""
        progress = (self.episodes - self.hp.stage1_episodes) / max(1, self.hp.stage2_episodes)
        return self.hp.lr * (1 - 0.9 * min(max(progress, 0.0), 1.0))

    def validate(self) -> dict[str, float]:
        """SR and CF-SR on the frozen validation episodes, argmax."""
        networks = TorchNetworks(self.model, self.predictor, self.stage.feed_prediction)
        results = run_episodes(networks, self.validation, self.frozen)
        return {"validation_sr": sr(results), "validation_cf_sr": cf_sr(results)}

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

    def _forget_later_lines(self) -> None:
        """Take lines out of the log of what is trained again: a killed run wrote them.

        Raises:
            CheckpointError: the log is no such log.
        """
        path = self.options.out / LOG
        if not path.exists():
            return
        lines = path.read_text().splitlines(keepends=True)
        ended = [line for line in lines if line.endswith("}\n")]  # a kill may tear the last
        try:
            kept = [line for line in ended if json.loads(line)["episodes"] <= self.episodes]
        except (ValueError, KeyError, TypeError) as error:
            raise CheckpointError(
                f"found no readable log at {path} ({error}); move it away to go on without it"
            ) from error
        if kept != lines:
            write_file(path, "".join(kept))

    def log(self, figures: dict[str, Any]) -> None:
        """Append one line to log.jsonl, and the same numbers as TensorBoard scalars.

        Raises:
            WriteError: the disk is full or refuses.
        """
        path = self.options.out / LOG
        with writing(path), path.open("a") as file:
            file.write(json.dumps(figures) + "\n")
        if self._board is None:
            # scalars of episodes that a killed run lost are hidden
            self._board = SummaryWriter(self.options.out, purge_step=self.episodes)
        for name, value in figures.items():
            self._board.add_scalar(name, value, self.episodes)
        self._board.flush()

    @property
    def stage(self) -> Stage:
        """Alg. 1: stage one while E < E_1, stage two from then on."""
        first = self.episodes < self.hp.stage1_episodes
        return self.method.stage1 if first else self.method.stage2
