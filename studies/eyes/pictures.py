"""The labelled real pictures: ``real_pictures.yaml``, and what a square crop shows of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from cfnav_core.perception.boxes import Box
from cfnav_core.perception.pictures import window
from cfnav_core.task.vocabulary import CATEGORIES

TABLE = Path(__file__).with_name("real_pictures.yaml")

KINDS = ("room", "furniture", "thing")
"""What a picture is of: a whole room or its furniture, a table top or the like, a single thing."""

COUNTED = 0.4
"""Share of a thing's box that must lie in the crop for it to count as shown; with less it is
unclear, and with less than ``LOST`` it is not shown."""

LOST = 0.05


@dataclass(frozen=True)
class Package:
    """Where pictures are found.

    Attributes:
        registry: pip, npm or apt.
        name: as the registry spells it.
        version: that was looked at; apt gives the one of the machine's release.
        licence: of the package, and of its pictures where it says so.
        free: its pictures may be passed on with no more than their credit.
    """

    registry: str
    name: str
    version: str
    licence: str
    free: bool = False


@dataclass(frozen=True)
class Picture:
    """One real picture with labels made by hand.

    Attributes:
        name: of its file in the cache.
        package: key of its package.
        path: inside the package.
        inside: where in that file, when it is not a picture itself; see ``extract``.
        sha256: of the extracted file.
        size: width and height, pixels.
        kind: of ``KINDS``.
        note: what is seen.
        licence: of the picture, where it is another than its package's.
        free: see ``Package``.
        camera: what is known of it; empty: nothing.
        shown: categories to the boxes of the things, pixels.
        unclear: categories that are too small or doubtful to count either way.
    """

    name: str
    package: str
    path: str
    inside: str
    sha256: str
    size: tuple[int, int]
    kind: str
    note: str
    licence: str
    free: bool
    camera: str
    shown: Mapping[str, tuple[Box, ...]]
    unclear: tuple[str, ...]


@dataclass(frozen=True)
class Crop:
    """A cut of a picture and what is in it.

    Attributes:
        rgb: uint8 [H, W, 3].
        labels: int8 [C], by ``CATEGORIES``: 1 shown, 0 not, -1 unclear.
        boxes: of what is shown, pixels of the crop.
    """

    rgb: np.ndarray
    labels: np.ndarray
    boxes: Mapping[str, tuple[Box, ...]]


def load_pictures(path: Path = TABLE) -> tuple[dict[str, Package], tuple[Picture, ...]]:
    """Read the table.

    Raises:
        ValueError: a picture twice, a category or kind that does not exist, or a missing entry.
    """
    try:
        table = yaml.safe_load(path.read_text())
        packages = {key: Package(**row) for key, row in table["packages"].items()}
        pictures = tuple(_picture(row, packages) for row in table["pictures"])
    except (OSError, TypeError, KeyError, AttributeError, yaml.YAMLError) as error:
        raise ValueError(f"found no readable table of pictures at {path} ({error})") from error
    names = [picture.name for picture in pictures]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"found {', '.join(twice)} twice in {path}, expected each picture once")
    return packages, pictures


def _picture(row: dict, packages: Mapping[str, Package]) -> Picture:
    boxes = row.get("boxes", {})
    picture = Picture(
        name=row["name"], package=row["package"], path=row["path"], inside=row.get("inside", ""),
        sha256=row["sha256"], size=tuple(row["size"]), kind=row["kind"], note=row["note"],
        licence=row.get("licence", ""), free=row.get("free", packages[row["package"]].free),
        camera=row.get("camera", ""),
        shown={word: tuple(map(tuple, boxes.get(word, ()))) for word in row["shown"]},
        unclear=tuple(row.get("unclear", ())),
    )  # fmt: skip
    words = [*picture.shown, *picture.unclear]
    strange = {*words, *boxes} - {*CATEGORIES} | {*boxes} - {*picture.shown}
    if strange or len({*words}) < len(words):
        raise ValueError(
            f"found labels {sorted(strange or words)} of picture {picture.name}, expected each "
            "category once, shown or unclear, and boxes of what is shown"
        )
    if picture.kind not in KINDS or picture.package not in packages:
        raise ValueError(
            f"found picture {picture.name} of kind {picture.kind} in package {picture.package}, "
            f"expected one of {', '.join(KINDS)} and of {', '.join(packages)}"
        )
    return picture


def crop(picture: Picture, rgb: np.ndarray, aspect: float) -> Crop:
    """Cut a picture to a network's shape, and count the labels that lie in the cut.

    A thing without a box counts as in the cut.
    """
    left, top, right, bottom = window(rgb.shape[1], rgb.shape[0], aspect)
    labels = np.zeros(len(CATEGORIES), np.int8)
    kept: dict[str, tuple[Box, ...]] = {}
    for word, boxes in picture.shown.items():
        inside = [share_inside(box, (left, top, right, bottom)) for box in boxes] or [1.0]
        best = max(inside)
        labels[CATEGORIES.index(word)] = 1 if best >= COUNTED else -1 if best >= LOST else 0
        kept[word] = tuple(
            (max(x0, left) - left, max(y0, top) - top, min(x1, right) - left, min(y1, bottom) - top)
            for (x0, y0, x1, y1), share in zip(boxes, inside, strict=False)
            if share >= COUNTED
        )
    for word in picture.unclear:
        labels[CATEGORIES.index(word)] = -1
    return Crop(rgb[top:bottom, left:right], labels, kept)


def share_inside(box: Box, cut: tuple[int, int, int, int]) -> float:
    """Share of a box's area that lies in a cut."""
    wide = min(box[2], cut[2]) - max(box[0], cut[0])
    high = min(box[3], cut[3]) - max(box[1], cut[1])
    return max(wide, 0) * max(high, 0) / ((box[2] - box[0]) * (box[3] - box[1]))
