"""One training run: stage one, stage two, checkpoints, validation, a log line as JSON.

``train`` -> ``algorithm`` -> ``env`` is the whole stack.
"""

from __future__ import annotations

import json
import subprocess
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from tqdm import tqdm

from cfnav_core.algorithm import Memory, collect_rollout, losses
from cfnav_core.checkpoint import (
    load_module,
    load_tensors,
    optimizer_tensors,
    restore_optimizer,
    save_tensors,
)
from cfnav_core.collision_predictor import CollisionPredictor
from cfnav_core.config import TrainOptions
from cfnav_core.env import ObjectNavEnv, SceneBank
from cfnav_core.evaluate import Episodes, run_episodes
from cfnav_core.methods import METHODS
from cfnav_core.metrics import cf_sr, sr
from cfnav_core.models import MODELS
from cfnav_core.networks import TorchNetworks
from cfnav_core.vocabulary import CATEGORIES

CHECKPOINT, STAGE1, BEST = "checkpoint.safetensors", "stage1.safetensors", "best.safetensors"


class Run:
    """State of one training run.

    Raises:
        SceneError: the scenes cannot be used.
        CheckpointError: an existing checkpoint belongs to another configuration.
    """

    def __init__(
        self, options: TrainOptions, train_rooms: list[tuple[str, int]],
        validation_rooms: list[tuple[str, int]],
    ) -> None:  # fmt: skip
        shared = set(train_rooms) & set(validation_rooms)
        if shared:
            raise ValueError(f"found rooms in both training and validation: {sorted(shared)}")
        config = options.run
        self.options, self.hp = options, config.hyperparameters
        self.method = METHODS[config.method]
        torch.manual_seed(config.seed)
        self.model = MODELS[config.model](config.size.hidden)
        self.predictor = CollisionPredictor(config.size.predictor_hidden)
        self.optimizer = torch.optim.Adam(self.model.parameters(), self.hp.lr, fused=True)
        self.predictor_optimizer = torch.optim.Adam(
            self.predictor.parameters(), self.hp.lr, fused=True
        )
        self.bank = SceneBank.load(options.scenes, train_rooms)
        self.validation = SceneBank.load(options.scenes, validation_rooms)
        self.frozen = Episodes.draw(self.validation, options.validation_episodes, seed=1)
        self.episodes, self.steps, self.best = 0, 0, -1.0
        self.commit = commit()  # of the code that is loaded, whatever happens to the tree later
        self.options.out.mkdir(parents=True, exist_ok=True)

    @property
    def total(self) -> int:
        """E_1 + E_2."""
        return self.hp.stage1_episodes + self.hp.stage2_episodes

    def resume(self) -> None:
        """Go on from the run's own checkpoint, else from a given stage one, else from nothing."""
        own = self.options.out / CHECKPOINT
        source = own if own.exists() else self.options.stage1
        if source is None:
            return
        tensors, head = load_tensors(source)
        if head["perception"] != self.bank.perception:
            raise ValueError(
                f"found {source} trained with perception {head['perception']}, but the scenes have "
                f"{self.bank.perception}; give scenes of the same perception"
            )
        load_module(source, "model", self.model, tensors)
        load_module(source, "predictor", self.predictor, tensors)
        restore_optimizer("optimizer", self.optimizer, tensors)
        restore_optimizer("predictor_optimizer", self.predictor_optimizer, tensors)
        self.episodes, self.steps = head["episodes"], head["steps"]
        if source == own:
            self.best = head["best"]

    def save(self, name: str) -> None:
        """Write everything the run needs to go on."""
        tensors = {f"model.{k}": v for k, v in self.model.state_dict().items()}
        tensors |= {f"predictor.{k}": v for k, v in self.predictor.state_dict().items()}
        tensors |= optimizer_tensors("optimizer", self.optimizer)
        tensors |= optimizer_tensors("predictor_optimizer", self.predictor_optimizer)
        goals = sorted({CATEGORIES[t.goal] for t in self.bank.tasks})
        save_tensors(self.options.out / name, tensors, {
            "config": asdict(self.options.run), "episodes": self.episodes, "steps": self.steps,
            "best": self.best, "perception": self.bank.perception, "goals": goals,
            "commit": self.commit, "train_rooms": self.options.train_rooms,
            "validation_rooms": self.options.validation_rooms,
        })  # fmt: skip

    def learning_rate(self) -> float:
        """Constant in stage one, falling linearly to a tenth during stage two."""
        progress = (self.episodes - self.hp.stage1_episodes) / max(1, self.hp.stage2_episodes)
        return self.hp.lr * (1 - 0.9 * min(max(progress, 0.0), 1.0))

    def validate(self) -> dict[str, float]:
        """SR and CF-SR on the frozen validation episodes, argmax."""
        feeds = self.method.stage2.feed_prediction and self.episodes >= self.hp.stage1_episodes
        networks = TorchNetworks(self.model, self.predictor, feeds)
        results = run_episodes(networks, self.validation, self.frozen)
        return {"validation_sr": sr(results), "validation_cf_sr": cf_sr(results)}

    def log(self, figures: dict[str, Any]) -> None:
        """Append one line to log.jsonl."""
        with (self.options.out / "log.jsonl").open("a") as file:
            file.write(json.dumps(figures) + "\n")

    def update(self, env: ObjectNavEnv, memory: Memory, generator: torch.Generator) -> dict:
        """One round of Algorithm 1: roll out, gradients, step."""
        stage = (
            self.method.stage1 if self.episodes < self.hp.stage1_episodes else self.method.stage2
        )
        memory.detach()
        rollout = collect_rollout(
            env, self.model, self.predictor, memory, stage, self.hp.rollout_length, generator
        )
        loss, collision, figures = losses(rollout, stage, self.hp)
        for group in self.optimizer.param_groups:
            group["lr"] = self.learning_rate()
        self.optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.model.parameters(), self.hp.max_grad_norm)
        self.optimizer.step()
        if collision is not None:
            self.predictor_optimizer.zero_grad()
            collision.backward()
            torch.nn.utils.clip_grad_norm_(self.predictor.parameters(), self.hp.max_grad_norm)
            self.predictor_optimizer.step()
        self.episodes += rollout.episodes
        self.steps += env.batch * self.hp.rollout_length
        figures |= {k: getattr(rollout, k) for k in ("successes", "collision_free", "collisions")}
        return figures | {"ended": rollout.episodes}


def train(
    options: TrainOptions, train_rooms: list[tuple[str, int]],
    validation_rooms: list[tuple[str, int]],
) -> Path:  # fmt: skip
    """Run both stages; returns the best checkpoint of stage two by validation CF-SR."""
    torch.set_num_threads(options.threads)
    run = Run(options, train_rooms, validation_rooms)
    run.resume()
    rng = np.random.default_rng([options.run.seed, run.episodes])
    generator = torch.Generator().manual_seed(options.run.seed * 7_919 + run.episodes)
    env = ObjectNavEnv(run.bank, run.hp.batch, rng)
    memory = Memory.zeros(run.hp.batch, run.model, run.predictor)
    bar = tqdm(total=run.total, initial=run.episodes, unit="episode", mininterval=5)
    saved = time.monotonic()
    sums: dict[str, float] = {}
    next_validation = run.episodes + options.validation_every
    while run.episodes < run.total:
        in_stage1 = run.episodes < run.hp.stage1_episodes
        before, first_step = run.episodes, run.steps
        for key, value in run.update(env, memory, generator).items():
            sums[key] = sums.get(key, 0.0) + value
        sums["updates"] = sums.get("updates", 0) + 1
        sums["steps"] = sums.get("steps", 0) + run.steps - first_step
        bar.update(run.episodes - before)
        if in_stage1 and run.episodes >= run.hp.stage1_episodes:
            run.save(STAGE1)
        if run.episodes >= next_validation or run.episodes >= run.total:
            next_validation += options.validation_every
            _validate_and_log(run, sums, bar)
            sums = {}
        if time.monotonic() - saved > options.checkpoint_s:
            run.save(CHECKPOINT)
            saved = time.monotonic()
    run.save(CHECKPOINT)
    bar.close()
    return options.out / BEST


def _validate_and_log(run: Run, sums: dict[str, float], bar: tqdm) -> None:
    ended, updates = max(1.0, sums["ended"]), sums["updates"]
    figures = {
        "episodes": run.episodes, "steps": run.steps,
        "sr": sums["successes"] / ended, "cf_sr": sums["collision_free"] / ended,
        "collisions_per_episode": sums["collisions"] / ended, "length": sums["steps"] / ended,
        **{k: v / updates for k, v in sums.items() if k.endswith("loss") or k == "entropy"},
        **run.validate(),
    }  # fmt: skip
    run.log(figures)
    bar.set_postfix_str(
        f"SR {figures['sr']:.2f} CF-SR {figures['cf_sr']:.2f} | validation "
        f"SR {figures['validation_sr']:.2f} CF-SR {figures['validation_cf_sr']:.2f}"
    )
    if run.episodes > run.hp.stage1_episodes and figures["validation_cf_sr"] > run.best:
        run.best = figures["validation_cf_sr"]
        run.save(BEST)


def commit() -> str:
    """Commit of the source tree, "unknown" outside a checkout."""
    answer = subprocess.run(
        ["git", "-C", str(Path(__file__).parent), "rev-parse", "--short", "HEAD"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    return answer.stdout.strip() or "unknown"
