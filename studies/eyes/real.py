"""Judge perception networks on real pictures: ``python -m studies.eyes.real``.

A picture is cut to the largest centred window of the network's aspect, a square for the built-in
network, and detectors get the same cut. A thing counts as shown when two fifths of its box lie in
the cut; what is unclear is not counted. A picture that is smaller than the network's input is
enlarged. Writes real.md, real.json and, for each network, a page of all pictures and one of those
that may be passed on.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from cfnav_core.command import command_line, run_options
from cfnav_core.files.json_file import write_json
from cfnav_core.files.provenance import commit
from cfnav_core.files.whole import write_file
from cfnav_core.perception.boxes import LEAST, Box
from cfnav_core.perception.pictures import Colour, read_rgb
from cfnav_core.task.vocabulary import CATEGORIES
from studies.engine.pages import table
from studies.eyes.detectors import CATEGORY_OF
from studies.eyes.draw import BLUE, GREEN, ORANGE, RED, draw, tile, words
from studies.eyes.fetch import CACHE, picture_path
from studies.eyes.judge import ENOUGH, Judgement, difference, judge
from studies.eyes.networks import Boxes, Network, networks
from studies.eyes.pictures import TABLE, Crop, Picture, crop, load_pictures

EVEN = 0.5
"""Recall at which the false alarms of networks are compared."""

ALL = "All categories"

AMONG = {
    "COCO's categories": np.array([name in CATEGORY_OF.values() for name in CATEGORIES]),
    ALL: np.ones(len(CATEGORIES), bool),
}
"""Which categories are judged together; a network that does not know all of them is left out."""


@dataclass(frozen=True)
class RealOptions:
    """Judge perception networks and COCO detectors on real pictures."""

    perception: tuple[Path, ...] = ()
    """ONNX files of perception networks of one aspect; the shipped bundle's when absent."""
    detector: tuple[Path, ...] = ()
    """ONNX files of COCO detectors (python -m studies.eyes.fetch --detectors)."""
    cache: Path = CACHE
    """Folder of the fetched pictures (python -m studies.eyes.fetch)."""
    out: Path = Path("out/eyes/real")
    """Folder of the results."""
    pictures: Path = TABLE
    """Table of the pictures."""


def cut_pictures(options: RealOptions, aspect: float) -> tuple[list[Picture], list[Crop]]:
    """Every picture that was fetched, cut.

    Raises:
        ValueError: there are fewer than ``ENOUGH``.
    """
    _, pictures = load_pictures(options.pictures)
    there = [p for p in pictures if picture_path(options.cache, p).exists()]
    if len(there) < ENOUGH:
        raise ValueError(
            f"found {len(there)} pictures in {options.cache}, expected {len(pictures)}; bring them "
            "with python -m studies.eyes.fetch"
        )
    if len(there) < len(pictures):
        print(f"{len(pictures) - len(there)} of {len(pictures)} pictures are not there")
    return there, [crop(p, read_rgb(picture_path(options.cache, p)), aspect) for p in there]


def _figure(value: float, ends: tuple[float, float]) -> str:
    return f"{value:.2f} [{ends[0]:.2f}, {ends[1]:.2f}]"


def as_markdown(found: Sequence[tuple[str, Judgement, Judgement]], labels: np.ndarray) -> str:
    """Tables: each network in short, and the AUC of every category.

    Args:
        found: name, judged at 0.5 and judged at a recall of ``EVEN``.
        labels: int8 [n, C].
    """
    short = table(
        {
            "network": lambda row: row[0],
            "categories": lambda row: f"{len(row[1].categories)} of {row[1].asked}",
            "mean AUC": lambda row: _figure(row[1].mean_auc, row[1].mean_auc_interval),
            "recall at 0.5": lambda row: _figure(row[1].recall, row[1].recall_interval),
            "false alarms a picture at 0.5": lambda row: _figure(
                row[1].false_alarms, row[1].false_alarms_interval
            ),
            f"threshold for recall {EVEN}": lambda row: f"{row[2].threshold:.3f}",
            "false alarms a picture there": lambda row: _figure(
                row[2].false_alarms, row[2].false_alarms_interval
            ),
        },
        found,
    )
    names = [c for c in range(len(CATEGORIES)) if (labels[:, c] == 1).any()]
    columns: dict[str, Callable] = {
        "category": lambda c: CATEGORIES[c],
        "shown in": lambda c: str(int((labels[:, c] == 1).sum())),
        "not in": lambda c: str(int((labels[:, c] == 0).sum())),
    }
    for name, judgement, _ in found:
        columns[name] = lambda c, auc=judgement.auc: (
            f"{auc[CATEGORIES[c]]:.2f}" if CATEGORIES[c] in auc else ""
        )
    return f"{short}\n{table(columns, names)}"


@dataclass(frozen=True)
class Seen:
    """Pictures, their labels, and what the networks say of them.

    Attributes:
        pictures: N of them. crops: of each. labels: int8 [N, C].
        scores: float [N, C] by network, NaN of categories that it does not know.
    """

    pictures: Sequence[Picture]
    crops: Sequence[Crop]
    labels: np.ndarray
    scores: Mapping[str, np.ndarray]


def run(options: RealOptions, command: str) -> str:
    """Judge, write and draw.

    Returns:
        The page for people.

    Raises:
        ValueError: networks or pictures cannot be used.
    """
    asked, aspect = networks(options.perception, options.detector)
    pictures, crops = cut_pictures(options, aspect)
    seen = Seen(
        pictures, crops, np.stack([cut.labels for cut in crops]),
        {n.name: np.stack([n.scores(cut.rgb) for cut in crops]) for n in asked},
    )  # fmt: skip
    judged = {title: judgements(seen, among) for title, among in AMONG.items()}
    first, *others = (n.name for n in asked)
    gains = {
        name: difference(seen.scores[first], seen.scores[name], seen.labels, AMONG[ALL])
        for name in others
    }
    page = _page(seen, judged, gains)
    options.out.mkdir(parents=True, exist_ok=True)
    write_file(options.out / "real.md", page)
    rows = {
        title: {name: {"at_half": asdict(a), "even": asdict(b)} for name, a, b in found}
        for title, found in judged.items()
    }
    write_json(options.out / "real.json", {
        "command": command, "commit": commit(), "rows": rows, "gains": gains,
        "networks": {n.name: n.sha256 for n in asked}, "scores": _scores_by_picture(seen),
    })  # fmt: skip
    for network in asked:
        _draw(seen, network, options.out)
    return page


def _page(
    seen: Seen,
    judged: Mapping[str, Sequence[tuple[str, Judgement, Judgement]]],
    gains: Mapping[str, tuple[float, tuple[float, float]]],
) -> str:
    """Everything for people, in Markdown."""
    first = next(iter(seen.scores))
    kinds = Counter(picture.kind for picture in seen.pictures)
    head = ", ".join(f"{count} of a {kind}" for kind, count in sorted(kinds.items()))
    return "\n".join([
        f"{len(seen.pictures)} pictures: {head}.\n",
        *(
            f"{title}:\n\n{as_markdown(found, seen.labels * AMONG[title])}"
            for title, found in judged.items() if found
        ),
        *(
            f"Mean AUC of {first} less that of {name}, on the same categories: {gain:+.2f} "
            f"[{ends[0]:+.2f}, {ends[1]:+.2f}]"
            for name, (gain, ends) in gains.items()
        ),
        "",
    ])  # fmt: skip


def judgements(seen: Seen, among: np.ndarray) -> list[tuple[str, Judgement, Judgement]]:
    """Each network that knows all of some categories: judged at 0.5, and at a recall of ``EVEN``.

    Args:
        seen: by the networks.
        among: bool [C].
    """
    return [
        (name, judge(s, seen.labels, among), judge(s, seen.labels, among, EVEN))
        for name, s in seen.scores.items()
        if not np.isnan(s[:, among]).any()
    ]


def _scores_by_picture(seen: Seen) -> dict[str, dict[str, dict[str, float]]]:
    return {
        picture.name: {
            name: {
                category: round(float(value), 4)
                for category, value in zip(CATEGORIES, s[k], strict=True)
                if not np.isnan(value)
            }
            for name, s in seen.scores.items()
        }
        for k, picture in enumerate(seen.pictures)
    }


def _draw(seen: Seen, network: Network, out: Path) -> None:
    """A page of all pictures for a network, and one of those that may be passed on."""
    scores = seen.scores[network.name]
    tiles = [
        tile(cut.rgb, _boxes(cut, scores[k], network.boxes), picture.name,
             words(CATEGORIES, scores[k], cut.labels, LEAST))
        for k, (picture, cut) in enumerate(zip(seen.pictures, seen.crops, strict=True))
    ]  # fmt: skip
    name = network.name.replace(" ", "_").replace("/", "_")
    draw(tiles, out / f"{name}.jpg")
    free = [one for one, picture in zip(tiles, seen.pictures, strict=True) if picture.free]
    if free:
        draw(free, out / f"{name}_free.jpg")


def _boxes(cut: Crop, scores: np.ndarray, boxes: Boxes | None) -> list[tuple[Box, Colour]]:
    """Boxes with their colours: drawn by hand, and of the network."""
    label = dict(zip(CATEGORIES, cut.labels, strict=True))
    by_hand = [
        (box, GREEN if scores[CATEGORIES.index(name)] >= LEAST else ORANGE)
        for name, drawn in cut.boxes.items()
        for box in drawn
    ]
    found = boxes(cut.rgb) if boxes else []
    return by_hand + [
        (one.box, BLUE if label[one.name] == 1 else RED) for one in found if label[one.name] != -1
    ]


def main(options: RealOptions) -> None:
    """Judge and print the page."""
    print(run(options, command_line()))


if __name__ == "__main__":
    sys.exit(run_options("real", RealOptions, main))
