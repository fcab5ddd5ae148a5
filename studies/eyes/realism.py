"""How much of rendered rooms a COCO detector knows: ``python -m studies.eyes.realism``.

It was trained on photographs, so what it finds in a rendering says how real that looks. A thing of
its classes counts when it fills at least ``LEAST_SHARE`` of the picture, and is found when a
detection of its class with a score above ``SCORE`` overlaps it, each detection one thing at most.
``--furniture real`` asks the same of the boxes in the real pictures, which is what a rendering
could reach at best.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from cfnav_core.command import command_line, run_options
from cfnav_core.detect.detector import OnnxDetector
from cfnav_core.files.json_file import write_json
from cfnav_core.files.provenance import commit, sha256
from cfnav_core.perception.boxes import Box, Detection
from cfnav_core.perception.pictures import read_rgb
from cfnav_core.task.intervals import interval_of_share
from studies.eyes.detectors import CATEGORY_OF, load_detector, overlap, paired
from studies.eyes.fetch import CACHE, picture_path
from studies.eyes.pictures import TABLE, crop, load_pictures
from studies.eyes.rooms import boxes_of, views_of_rooms

LEAST_SHARE = 0.004
"""Of the picture that a thing must fill to count."""

SCORE = 0.3

OVERLAP = 0.3
"""Intersection through union of a detection and a thing for it to be found."""

ENOUGH = 5
"""Things of a class for it to count in the mean over classes."""

CLASSES: dict[str, tuple[str, ...]] = {
    **{category: (name,) for name, category in CATEGORY_OF.items()},
    "ArmChair": ("chair", "couch"),
    "Sofa": ("couch",), "sofa": ("couch",), "Bed": ("bed",), "bed_double": ("bed",),
    "bed_single": ("bed",), "Toilet": ("toilet",), "toilet": ("toilet",),
}  # fmt: skip
"""COCO's classes by the name of a thing in a room or a category, the one that it is counted under
first; tables of many kinds are not asked for."""


@dataclass(frozen=True)
class RealismOptions:
    """Count what a COCO detector finds in rendered rooms."""

    furniture: Literal["built_in", "sweet_home", "real"] = "built_in"
    """Of the rooms; real: the real pictures instead of rooms."""
    rooms: tuple[str, ...] = ("kitchen:20-24", "living_room:20-24", "bedroom:20-24",
                              "bathroom:20-24")  # fmt: skip
    """TYPE:SEED or TYPE:FIRST-LAST."""
    views: int = 10
    """Random views a room."""
    detector: Path = CACHE / "detectors/nanodet.onnx"
    """ONNX file of a COCO detector (python -m studies.eyes.fetch --detectors)."""
    cache: Path = CACHE
    """Folder of the fetched pictures."""
    json: Path | None = None
    """Also write the figures here."""


@dataclass(frozen=True)
class View:
    """One picture and the things of COCO's classes in it.

    Attributes:
        group: room or picture; groups are drawn anew for intervals.
        rgb: uint8 [H, W, 3].
        things: names and boxes in pixels of those that fill enough of it.
    """

    group: str
    rgb: np.ndarray
    things: tuple[tuple[str, Box], ...]


def rendered(options: RealismOptions) -> Iterator[View]:
    """Random views of rooms from the mast.

    Raises:
        ValueError: rooms that do not exist here.
    """
    before = "" if options.furniture == "built_in" else f"{options.furniture}."
    rooms = [before + text for text in options.rooms]
    for room, picture, names in views_of_rooms(rooms, options.views):
        yield View(room, picture.rgb, things_of(picture.owner, names))


def things_of(owner: np.ndarray, names: list[str]) -> tuple[tuple[str, Box], ...]:
    """Names and boxes of the things of COCO's classes that fill enough of a picture.

    Args:
        owner: int [H, W], index into ``names`` of what is seen there, -1 for none.
        names: of things.
    """
    return tuple(
        (name, box) for name, box, pixels in boxes_of(owner, names)
        if name in CLASSES and pixels >= LEAST_SHARE * owner.size
    )  # fmt: skip


def views_of_pictures(cache: Path) -> Iterator[View]:
    """The real pictures cut to squares, with the boxes drawn by hand."""
    for picture in load_pictures(TABLE)[1]:
        path = picture_path(cache, picture)
        if path.exists():
            cut = crop(picture, read_rgb(path), 1.0)
            area = cut.rgb.shape[0] * cut.rgb.shape[1]
            yield View(picture.name, cut.rgb, tuple(
                (name, box) for name, boxes in cut.boxes.items() for box in boxes
                if name in CLASSES
                and (box[2] - box[0]) * (box[3] - box[1]) >= LEAST_SHARE * area
            ))  # fmt: skip


def found_of(things: Sequence[tuple[str, Box]], detections: Sequence[Detection]) -> np.ndarray:
    """Which things have a detection of their class for themselves: bool [things]."""
    boxes = np.array([one.box for one in detections]).reshape(-1, 4)
    shared = np.zeros((len(things), len(detections)))
    for k, (name, box) in enumerate(things):
        of_class = np.array([one.name in CLASSES[name] for one in detections], bool)
        shared[k] = of_class * overlap(np.array(box), boxes)
    return paired(shared, OVERLAP)


@dataclass(frozen=True)
class Counts:
    """Things by COCO's class and by group.

    Attributes:
        pictures: that were looked at.
        there: that fill enough of a picture. found: of these.
    """

    pictures: int
    there: Counter[tuple[str, str]]
    found: Counter[tuple[str, str]]

    def of(self, place: int, key: str) -> tuple[int, int]:
        """How many were found, and are there, of a class (place 0) or in a group (place 1)."""
        found, there = (
            sum(count for at, count in which.items() if at[place] == key)
            for which in (self.found, self.there)
        )
        return found, there

    def by_class(self) -> dict[str, tuple[int, int]]:
        """How many were found, and are there, of each class."""
        return {name: self.of(0, name) for name in sorted({name for name, _ in self.there})}

    def recall(self) -> tuple[float, tuple[float, float]]:
        """Share that was found, and its 95 % interval over groups."""
        groups = sorted({group for _, group in self.there})
        counts = [self.of(1, group) for group in groups]
        values = np.concatenate([np.arange(there) < found for found, there in counts])
        of = np.repeat(np.arange(len(groups)), [there for _, there in counts])
        return float(values.mean()), interval_of_share(values, of)


def count(views: Iterable[View], detector: OnnxDetector) -> Counts:
    """What a detector finds.

    Raises:
        ValueError: there is nothing to be found.
    """
    there: Counter[tuple[str, str]] = Counter()
    hits: Counter[tuple[str, str]] = Counter()
    pictures = 0
    for view in views:
        pictures += 1
        found = found_of(view.things, detector(view.rgb, SCORE))
        for (name, _), is_found in zip(view.things, found, strict=True):
            there[CLASSES[name][0], view.group] += 1
            hits[CLASSES[name][0], view.group] += bool(is_found)
    if not there:
        raise ValueError(f"found nothing of COCO's classes in {pictures} pictures; give more")
    return Counts(pictures, there, hits)


def main(options: RealismOptions) -> None:
    """Count and print.

    Raises:
        ValueError: rooms, pictures or the detector cannot be used, or nothing is to be found.
    """
    detector = load_detector(options.detector)
    real = options.furniture == "real"
    views = views_of_pictures(options.cache) if real else rendered(options)
    counts = count(views, detector)
    recall, ends = counts.recall()
    by_class = counts.by_class()
    even = [n / of for n, of in by_class.values() if of >= ENOUGH]
    found, things = counts.found.total(), counts.there.total()
    print(
        f"{options.furniture}: {options.detector.stem} finds {found} of {things} things in "
        f"{counts.pictures} pictures, {recall:.2f} [{ends[0]:.2f}, {ends[1]:.2f}]; mean over the "
        f"{len(even)} classes of {ENOUGH} things or more {np.mean(even or [np.nan]):.2f}"
    )
    print(", ".join(f"{name} {n}/{of}" for name, (n, of) in by_class.items()))
    if options.json is not None:
        write_json(options.json, {
            "command": command_line(), "commit": commit(), "found": found, "things": things,
            "recall": recall, "interval": ends, "pictures": counts.pictures,
            "by_class": by_class, "detector": sha256(options.detector),
        })  # fmt: skip


if __name__ == "__main__":
    sys.exit(run_options("realism", RealismOptions, main))
