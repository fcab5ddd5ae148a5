"""What a detector would say of things whose boxes are known: true boxes with a detector's errors.

Policies that read boxes learn from rendered rooms, where the boxes are true. They are given what a
real detector would make of them: it misses what is small, cut off or hidden, its boxes and scores
jitter, it takes one thing for another and sees some that are not there.
``python -m studies.eyes.errors`` measures how much of each.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.special import expit

from cfnav_core.perception.boxes import Box, Detection

SHIPPED = Path(__file__).with_name("errors.yaml")


@dataclass(frozen=True)
class Thing:
    """A thing that is in a picture.

    Attributes:
        name: what cfnav calls it.
        box: of what is seen of it, pixels.
        share: of the box that it would have if nothing hid it or cut it off, 0..1.
        distance: from the robot's middle to the nearest point of its footprint, metres.
    """

    name: str
    box: Box
    share: float
    distance: float


@dataclass(frozen=True)
class Recall:
    """The logit of how probably a thing is found.

    Attributes:
        base: of a thing of 1 degree, before what the others add.
        size: for each doubling of its box's side, the square root of its area in degrees.
        share: for all of it being seen, instead of nothing.
        distance: for each metre.
        names: for what is called so, beside the others.
    """

    base: float
    size: float
    share: float
    distance: float
    names: Mapping[str, float]

    def probability(self, thing: Thing, degrees: float) -> float:
        """Of finding a thing whose box has a side of so many degrees."""
        logit = (
            self.base + self.size * math.log2(degrees) + self.share * thing.share
            + self.distance * thing.distance + self.names.get(thing.name, 0.0)
        )  # fmt: skip
        return float(expit(logit))


@dataclass(frozen=True)
class ErrorModel:
    """A detector's errors.

    Attributes:
        recall: how probably it finds what.
        least: score below which it says nothing.
        found, invented: a and b of the beta distribution of scores from ``least`` to 1, of what is
            there and of what is not.
        jitter: standard deviation of each edge of a box, as a share of its width or height.
        false_alarms: that nothing causes, mean a picture and name that it knows.
        confused: share of what it finds that it calls by another name.
        confusions: by which names, with weights, by the true one; any other where none is told.
    """

    recall: Recall
    least: float
    found: tuple[float, float]
    invented: tuple[float, float]
    jitter: float
    false_alarms: float
    confused: float
    confusions: Mapping[str, Mapping[str, float]]

    @classmethod
    def load(cls, path: Path = SHIPPED) -> ErrorModel:
        """Read a file like ``errors.yaml``.

        Raises:
            ValueError: it is missing or no such file; one sentence.
        """
        try:
            said: dict[str, Any] = yaml.safe_load(path.read_text())
            values = {one.name: said[one.name] for one in fields(cls)}
            pairs = {name: tuple(map(float, values[name])) for name in ("found", "invented")}
            model = cls(**values | pairs | {"recall": Recall(**values["recall"])})
            model.check()
            return model
        except (OSError, yaml.YAMLError, LookupError, AttributeError, TypeError, ValueError) as e:
            raise ValueError(
                f"found no readable errors of a detector in {path} ({' '.join(str(e).split())})"
                "; measure them with python -m studies.eyes.errors"
            ) from e

    def check(self) -> None:
        """Look at the numbers.

        Raises:
            ValueError: one makes no sense.
        """
        recall = self.recall
        numbers = (recall.base, recall.size, recall.share, recall.distance, *recall.names.values())
        if not all(math.isfinite(number) for number in numbers):
            raise ValueError("recall has a number that is not finite")
        for name, most in (("least", 1), ("confused", 1), ("jitter", 9), ("false_alarms", 9)):
            if not 0 <= getattr(self, name) < most:
                raise ValueError(f"{name} is {getattr(self, name)}, expected 0 to {most}")
        for name in ("found", "invented"):
            if len(getattr(self, name)) != 2 or not min(getattr(self, name)) > 0:
                raise ValueError(f"{name} is {getattr(self, name)}, expected two numbers above 0")
        if not all(weight > 0 for row in self.confusions.values() for weight in row.values()):
            raise ValueError("confusions has a weight that is not above 0")

    def says(
        self, things: Sequence[Thing], names: Sequence[str], size: tuple[int, int], degree: float,
        rng: np.random.Generator,
    ) -> list[tuple[Detection, Thing | None]]:  # fmt: skip
        """What it says of a picture, and of which thing; of none where there is nothing.

        Args:
            things: that are in it.
            names: all that it knows; it says nothing else and misses what else is there.
            size: width and height of the picture, pixels.
            degree: pixels of one degree in the middle of the picture.
            rng: gives every error.
        """
        said: list[tuple[Detection, Thing | None]] = []
        for thing in things:
            left, top, right, bottom = thing.box
            side = math.sqrt((right - left) * (bottom - top)) / degree
            if thing.name not in names or rng.random() >= self.recall.probability(thing, side):
                continue
            mistaken = rng.random() < self.confused and len(names) > 1
            name = self._other(thing.name, names, rng) if mistaken else thing.name
            if box := self._jittered(thing.box, size, rng):
                said.append((Detection(name, self._score(self.found, rng), box), thing))
        alarms = range(rng.poisson(self.false_alarms * len(names)))
        return [*said, *((self._alarm(names, size, rng), None) for _ in alarms)]

    def _other(self, name: str, names: Sequence[str], rng: np.random.Generator) -> str:
        told = {k: v for k, v in self.confusions.get(name, {}).items() if k in names}
        others = list(told) or [other for other in names if other != name]
        weights = np.array(list(told.values()) or np.ones(len(others)))
        return str(rng.choice(others, p=weights / weights.sum()))

    def _score(self, shape: tuple[float, float], rng: np.random.Generator) -> float:
        return self.least + (1 - self.least) * float(rng.beta(*shape))

    def _jittered(self, box: Box, size: tuple[int, int], rng: np.random.Generator) -> Box | None:
        extent = np.array([box[2] - box[0], box[3] - box[1]] * 2)
        moved = np.array(box) + rng.normal(0, self.jitter, 4) * extent
        left, top, right, bottom = map(float, moved.clip(0, [*size, *size]))
        return (left, top, right, bottom) if left < right and top < bottom else None

    def _alarm(
        self, names: Sequence[str], size: tuple[int, int], rng: np.random.Generator
    ) -> Detection:
        """Anything anywhere: a side of a twentieth to a half of the picture's height."""
        wide, high = size[1] * np.exp(rng.uniform(math.log(0.05), math.log(0.5), 2))
        left, top = rng.uniform(0, [size[0] - wide, size[1] - high])
        box = (float(left), float(top), float(left + wide), float(top + high))
        return Detection(str(rng.choice(names)), self._score(self.invented, rng), box)
