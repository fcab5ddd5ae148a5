"""Training runs that the rows need: what identifies one, where it lies, what it waits for."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, get_args

from cfnav_core.agent.config import MethodName, ModelName, RunConfig, TrainOptions
from cfnav_core.agent.methods import METHODS
from cfnav_core.learn.run_files import STAGE1
from cfnav_core.models.size import PUBLISHED
from cfnav_core.task.rooms import SPLITS
from studies.engine.presets import PRESETS, PresetName
from studies.engine.row import Row, Schedule, Split, Variant

SHARED_STAGE1: MethodName = "ours"
"""Its stage one is that of every method without a rule of its own there: the predictor that it
trains beside the policy reaches nobody in stage one."""


@dataclass(frozen=True)
class GridFolders:
    """Where a grid finds and puts things.

    Attributes:
        scenes: folder of the built-in scenes.
        out: folder of the grid.
    """

    scenes: Path
    out: Path

    def knowledge(self, split: Split) -> Path:
        """What models know of a split's training rooms."""
        return self.out / f"knowledge_{split}.safetensors"


@dataclass(frozen=True)
class Job:
    """One training run.

    Attributes:
        perception: identity of what made the scenes' features.
        schedule: see ``Schedule``.
        variant: see ``Variant``.
    """

    model: ModelName
    method: MethodName
    split: Split
    seed: int
    preset: PresetName
    perception: str
    schedule: Schedule = "usual"
    variant: Variant = ""

    @property
    def config(self) -> RunConfig:
        """What is trained."""
        run = PRESETS[self.preset].run(self.model, self.method, self.seed, self.schedule)
        match self.variant:
            case "listening":
                return replace(run, listening=True)
            case "dropout":
                return replace(run, size=replace(run.size, dropout=PUBLISHED.dropout))
            case _:
                return run

    @property
    def validations(self) -> int:
        """In its stage two."""
        preset = PRESETS[self.preset]
        return preset.validations_tenfold if self.schedule == "tenfold" else preset.validations

    @property
    def hash(self) -> str:
        """First 12 hex digits of the hash of what decides its numbers.

        Code, device and precision are left out: the commit stands beside the results, and a grid is
        trained on machines of one kind.
        """
        about = {
            "run": asdict(self.config), "split": self.split, "perception": self.perception,
            "validations": [self.validations, PRESETS[self.preset].validation_episodes],
        }  # fmt: skip
        text = json.dumps(about, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    @property
    def name(self) -> str:
        """Of its folder."""
        return f"{self.title.replace(' ', '_')}_{self.hash}"

    @property
    def title(self) -> str:
        """In words, for people."""
        schedule = "" if self.schedule == "usual" else self.schedule
        words = (self.split, self.model, self.method, self.variant, schedule, f"seed{self.seed}")
        return " ".join(filter(None, words))

    @property
    def stage1(self) -> Job | None:
        """The run whose stage one this one goes on from, None when it has its own."""
        method, shared = METHODS[self.method], METHODS[SHARED_STAGE1]
        alike = (shared.stage1, replace(shared.stage1, train_predictor=False))
        longer = self.schedule in ("longer", "tenfold")
        source = replace(self, schedule="usual") if longer else self
        if method.stage1 in alike and not method.shared_encoder:
            source = replace(source, method=SHARED_STAGE1)
        return None if source == self else source

    @classmethod
    def of_row(cls, row: Row, seed: int, preset: PresetName, perception: str) -> Job:
        """A run of a row."""
        ordinary = cls(
            row.model, row.method, row.split, seed, preset, perception, variant=row.variant
        )
        asked = replace(ordinary, schedule=row.schedule)
        return asked if asked.config != ordinary.config else ordinary

    @classmethod
    def of(cls, training: dict[str, Any]) -> Job | None:
        """The run that a bundle came from; None when it is that of no preset.

        Args:
            training: what ``BundleHead`` says of it.
        """
        try:
            config = RunConfig.read(training["config"])
            split, _, train = training["train_rooms"][0].partition(":")
        except (KeyError, TypeError, IndexError):
            return None
        if split not in SPLITS or train != "train":
            return None
        kinds = product(get_args(PresetName), get_args(Schedule), get_args(Variant))
        for preset, schedule, variant in kinds:
            job = cls(
                config.model, config.method, split, config.seed, preset, training["perception"],
                schedule, variant,
            )  # fmt: skip
            if config.model in PRESETS[preset].runs and job.config == config:
                return job
        return None

    def options(self, places: GridFolders) -> TrainOptions:
        """How it is trained."""
        config = self.config
        source = self.stage1
        return TrainOptions(
            scenes=places.scenes,
            train_rooms=(f"{self.split}:train",),
            validation_rooms=(f"{self.split}:validation",),
            out=places.out / "runs" / self.name,
            stage1=places.out / "runs" / source.name / STAGE1 if source else None,
            run=config,
            knowledge=places.knowledge(self.split),
            validation_every=config.hyperparameters.stage2_episodes // self.validations,
            validation_episodes=PRESETS[self.preset].validation_episodes,
        )


def jobs_of(
    rows: Iterable[Row], seeds: Iterable[int], preset: PresetName, perception: str
) -> list[Job]:
    """The runs that rows need, each once, those that others wait for first.

    Args:
        rows: of the tables.
        seeds: of each.
        preset: of sizes and numbers.
        perception: identity of the scenes' perception.
    """
    wanted: dict[Job, None] = {}
    compared = [of for row in rows for of in (row, row.reference, row.rival) if of]
    for seed in seeds:
        for row in compared:
            job = Job.of_row(row, seed, preset, perception)
            if job.stage1:
                wanted[job.stage1] = None
            wanted[job] = None
    return sorted(wanted, key=lambda job: (job.seed, job.stage1 is not None))
