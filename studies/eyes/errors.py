"""What COCO detectors get wrong, in rendered rooms and real pictures.

``python -m studies.eyes.errors`` writes ``cfnav_core/detect/errors.yaml``, the errors that true
boxes are given where a policy learns to read boxes. How much less is found of what is small, far or
half in view is measured in rendered rooms, where all of this is known. How much is found at all,
of which names, how boxes and scores jitter, what is confused and what is seen though it is not
there is measured in the real pictures: detectors know photographs better than renderings. Of those
it is known neither how far things are nor by what lens they were taken; ``REAL`` is assumed. Asked
is for the goals that COCO has classes of; all detectors that are named count alike.
"""

from __future__ import annotations

import math
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.optimize import minimize
from scipy.special import expit

from cfnav_core.command import command_line, run_options
from cfnav_core.detect.detector import OnnxDetector
from cfnav_core.detect.errors import SHIPPED, ErrorModel, Recall, Thing
from cfnav_core.files.provenance import commit
from cfnav_core.files.whole import write_file
from cfnav_core.perception.boxes import Detection
from cfnav_core.perception.pictures import read_rgb
from cfnav_core.task.camera import CameraSetUp
from cfnav_core.task.pinhole import Pinhole
from cfnav_core.task.vocabulary import CATEGORIES
from studies.eyes.detectors import CATEGORY_OF, best_pairs, load_detector, overlap
from studies.eyes.fetch import CACHE, picture_path
from studies.eyes.pictures import TABLE, load_pictures
from studies.eyes.rooms import things_of_rooms
from studies.eyes.sizes import PERCEPTION_ROOMS

SCORE = 0.3
"""Below this a detector says nothing."""

OVERLAP = 0.5
"""Intersection through union from which on a box is a thing's."""

POOR = 0.1
"""Intersection through union from which on a box that is nobody's is a poor one of some thing, and
no false alarm."""

KNOWN = sorted(set(CATEGORY_OF.values()) & set(CATEGORIES))

RIDGE = 1.0
"""Holds the numbers of single names, of which some have few things, near those of all."""

REAL = 60.0, 1.0, 2.0
"""Degrees across a real picture, share of a thing in view, and its distance, m."""

FOCAL = 0.5 / math.tan(math.radians(REAL[0]) / 2)
"""Of a real picture, as a share of its width."""

SIDES_DEG, DISTANCES_M, SHARES = (0, 3, 6, 12, 24, 180), (0, 1, 2, 3, 9), (0, 0.4, 0.8, 1.01)


@dataclass(frozen=True)
class ErrorOptions:
    """Measure what detectors get wrong."""

    detector: tuple[Path, ...] = tuple(
        CACHE / f"detectors/{name}.onnx" for name in ("nanodet", "coco_ssd", "centernet")
    )
    """ONNX files (python -m studies.eyes.fetch --detectors)."""
    rooms: tuple[str, ...] = PERCEPTION_ROOMS
    """TYPE:SEED or TYPE:FIRST-LAST."""
    views: int = 6
    """Random views a room and camera."""
    cameras: tuple[str, ...] = ("stock_wide", "mast")
    """By which they are seen, as for cfnav rooms make."""
    cache: Path = CACHE
    """Folder of the fetched real pictures."""
    out: Path = SHIPPED
    """The file."""


@dataclass
class Said:
    """What detectors said of pictures.

    Attributes:
        pictures: that they were shown, each detector's counted.
        things: that were there, each with the side of its box in degrees.
        found: bool, which of these.
        scores, edges: of those that were found: score, and how far each edge is off as a share of
            the thing's width or height.
        alarms: scores of what is not there.
        confused: the true name and the one that it was given.
    """

    pictures: int = 0
    things: list[tuple[Thing, float]] = field(default_factory=list)
    found: list[bool] = field(default_factory=list)
    scores: list[float] = field(default_factory=list)
    edges: list[np.ndarray] = field(default_factory=list)
    alarms: list[float] = field(default_factory=list)
    confused: Counter[tuple[str, str]] = field(default_factory=Counter)

    def add(
        self, things: Sequence[Thing], said: Sequence[Detection], degree: float,
        unclear: Sequence[str] = (),
    ) -> None:  # fmt: skip
        """Note what was said of a picture.

        Args:
            things: in it. said: of it. degree: pixels of one in its middle.
            unclear: names that may be in it: a detection of these is no false alarm.
        """
        self.pictures += 1
        things = [one for one in things if one.name in KNOWN]
        boxes = np.array([one.box for one in said]).reshape(-1, 4)
        shared = np.zeros((len(things), len(said)))
        for k, thing in enumerate(things):
            shared[k] = overlap(np.array(thing.box), boxes)
        same = np.array([[thing.name == one.name for one in said] for thing in things], bool)
        own = best_pairs(np.where(same.reshape(shared.shape), shared, 0), OVERLAP)
        rest = [k for k in range(len(things)) if k not in own]
        left = [k for k in range(len(said)) if k not in own.values()]
        others = best_pairs(shared[np.ix_(rest, left)], OVERLAP)
        pairs = own | {rest[k]: left[told] for k, told in others.items()}
        for k, thing in enumerate(things):
            box = np.array(thing.box)
            wide, high = box[2] - box[0], box[3] - box[1]
            self.things.append((thing, math.sqrt(wide * high) / degree))
            self.found.append(k in pairs)
            if k in pairs:
                told = said[pairs[k]]
                self.scores.append(told.score)
                self.edges.append((np.array(told.box) - box) / [wide, high, wide, high])
                if k not in own:
                    self.confused[thing.name, told.name] += 1
        beside = shared.max(0, initial=0) < POOR  # others are poor boxes, or second ones
        alone = set(np.flatnonzero(beside).tolist()) - set(pairs.values())
        self.alarms += [said[k].score for k in sorted(alone) if said[k].name not in unclear]


def _told(detector: OnnxDetector, rgb: np.ndarray) -> list[Detection]:
    """What a detector says of the goals that COCO knows, by cfnav's names."""
    named = (replace(one, name=detector.labels.category(one.name)) for one in detector(rgb, SCORE))
    return [one for one in named if one.name in KNOWN]


def ask_of_pictures(detectors: Sequence[OnnxDetector], cache: Path) -> Said:
    """Show the real pictures to detectors; those that are not in the cache are left out."""
    said, (_, share, distance) = Said(), REAL
    for picture in load_pictures(TABLE)[1]:
        path = picture_path(cache, picture)
        if not path.exists():
            continue
        rgb = read_rgb(path)
        things = [
            Thing(name, box, share, distance)
            for name, boxes in picture.shown.items() for box in boxes
        ]  # fmt: skip
        unclear = [*picture.unclear, *picture.shown]  # a further one may have no box
        degree = FOCAL * rgb.shape[1] * math.radians(1)
        for detector in detectors:
            said.add(things, _told(detector, rgb), degree, unclear)
    return said


def ask_of_rooms(detectors: Sequence[OnnxDetector], options: ErrorOptions) -> Said:
    """Show views of rooms to detectors.

    Raises:
        ValueError: rooms or cameras that there are not.
    """
    said = Said()
    for name in options.cameras:
        camera = CameraSetUp.read(name)
        degree = Pinhole.of(camera).fx * math.radians(1)
        for view in things_of_rooms(options.rooms, options.views, camera):
            for detector in detectors:
                said.add(view.things, _told(detector, view.rgb), degree)
    return said


def fitted(rooms: Said, pictures: Said) -> ErrorModel:
    """The errors as ``ErrorModel`` has them.

    Raises:
        ValueError: hardly anything was found, or nothing false was said.
    """
    for said, where in ((rooms, "rooms"), (pictures, "pictures")):
        if min(len(said.scores), len(said.alarms)) < 10:
            raise ValueError(
                f"found {len(said.scores)} things told and {len(said.alarms)} false alarms in "
                f"{where}, expected 10 or more of each; give more of them"
            )
    confusions: dict[str, dict[str, float]] = defaultdict(dict)
    for (true, told), count in sorted(pictures.confused.items()):
        confusions[true][told] = count
    _, slopes, _ = _likeliest(rooms)
    base, (size, share, distance), names = _likeliest(pictures, slopes)
    return ErrorModel(
        Recall(base, size, share, distance, names), SCORE,
        _beta(pictures.scores), _beta(pictures.alarms),
        round(float(np.std(pictures.edges)), 3),
        round(len(pictures.alarms) / pictures.pictures / len(KNOWN), 4),
        round(pictures.confused.total() / len(pictures.scores), 3), dict(confusions),
    )  # fmt: skip


def _likeliest(
    said: Said, slopes: Sequence[float] | None = None
) -> tuple[float, list[float], dict[str, float]]:
    """Numbers of ``Recall`` of the greatest likelihood: base, those between, and names.

    Args:
        said: of what.
        slopes: the three between where they are known.
    """
    names = sorted({thing.name for thing, _ in said.things})
    between = np.array([[math.log2(side), one.share, one.distance] for one, side in said.things])
    named = np.array([[1, *(one.name == name for name in names)] for one, _ in said.things], float)
    x = named if slopes else np.c_[named, between]
    given = between @ slopes if slopes else np.zeros(len(x))
    y, column = np.array(said.found, float), np.arange(x.shape[1])
    held = (column > 0) & (column <= len(names))  # near those of all

    def loss(w: np.ndarray) -> tuple[float, np.ndarray]:
        z, own = given + x @ w, held * w
        value = np.logaddexp(0, z).sum() - y @ z + RIDGE / 2 * own @ own
        return float(value), x.T @ (expit(z) - y) + RIDGE * own

    # What is further at the same size is larger, and large kinds may be known better: that is no
    # reason to find a thing more often from further away.
    last = (None, None if slopes else 0)
    bounds = [*[(None, None)] * (x.shape[1] - 1), last]
    fit = minimize(loss, np.zeros(x.shape[1]), jac=True, bounds=bounds)
    base, *best = fit.x.round(2).tolist()
    of_names = dict(zip(names, best, strict=False))
    return base, list(slopes) if slopes else best[len(names) :], of_names


def _beta(scores: Sequence[float]) -> tuple[float, float]:
    """A and b of scores from ``SCORE`` to 1, by their mean and variance."""
    share = (np.array(scores) - SCORE) / (1 - SCORE)
    mean, spread = float(share.mean()), float(share.var())
    total = mean * (1 - mean) / spread - 1
    return round(mean * total, 2), round((1 - mean) * total, 2)


def rows(said: Said) -> Iterator[str]:
    """Lines of a table: how much is found by size, distance and share."""
    sides = np.array([side for _, side in said.things])
    distances = np.array([thing.distance for thing, _ in said.things])
    shares = np.array([thing.share for thing, _ in said.things])
    found = np.array(said.found)
    yield "| what | from | to | things | found |"
    yield "|---|---|---|---|---|"
    for what, values, ends in (
        ("side of its box, degrees", sides, SIDES_DEG), ("distance, m", distances, DISTANCES_M),
        ("share of it in view", shares, SHARES),
    ):  # fmt: skip
        for low, high in pairwise(ends):
            here = (low <= values) & (values < high)
            if here.any():
                yield f"| {what} | {low} | {high} | {here.sum()} | {found[here].mean():.2f} |"


def _plain(model: ErrorModel) -> dict[str, Any]:
    return asdict(model) | {"found": list(model.found), "invented": list(model.invented)}


def main(options: ErrorOptions) -> None:
    """Ask, fit, write and print.

    Raises:
        ValueError: what cannot be used, or hardly anything was found.
    """
    detectors = [load_detector(path) for path in options.detector]
    pictures, rooms = ask_of_pictures(detectors, options.cache), ask_of_rooms(detectors, options)
    made = fitted(rooms, pictures)
    head = (
        f"# Errors of {', '.join(path.stem for path in options.detector)}:\n"
        f"# {command_line()}, commit {commit()}\n"
    )
    write_file(options.out, (head + yaml.safe_dump(_plain(made), sort_keys=False)).encode())
    for said, where in ((rooms, "rendered"), (pictures, "real")):
        print(
            f"{where}: {len(said.scores)} of {len(said.things)} things told in {said.pictures} "
            f"pictures, {said.confused.total()} of them by another name; {len(said.alarms)} false "
            "alarms"
        )
        print("\n".join(rows(said)))


if __name__ == "__main__":
    sys.exit(run_options("errors", ErrorOptions, main))
