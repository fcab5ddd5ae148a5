"""Judge perception networks on rendered pictures: ``python -m studies.eyes.rendered``.

The pictures are sets from ``cfnav rooms make --views N`` of rooms that no network here learnt from.
Rooms of test seeds have models, of some categories, that no other room has.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfnav_core.command import command_line, run_options
from cfnav_core.files.json_file import write_json
from cfnav_core.files.provenance import commit
from cfnav_core.perception.judge import agreement, counted, shown_in
from cfnav_core.perception.perception import OnnxPerception
from cfnav_core.perception.picture_set import HEAD, PictureSet
from cfnav_core.policy.bundle import shipped_perception
from cfnav_core.task.detections import columns
from cfnav_core.task.intervals import FEW
from cfnav_core.task.rooms import furniture_of, room_folder, rooms_in
from cfnav_core.task.visibility import least_pixels
from cfnav_core.task.vocabulary import CATEGORIES
from studies.engine.pages import Cell, table
from studies.eyes.judge import intervals

SAMPLES = 300
"""Draws of rooms for an interval."""
FIGURES = (
    "shown_auc_mean", "near_auc_mean", "near_ap", "near_f1", "near_but_far", "false_alarms",
)  # fmt: skip
TIMES = (1, 2, 4, 8, 32)
"""How many times as many pixels as a visible thing must have, where a class of sizes begins."""


def _figure(name: str) -> Cell:
    def text(row: dict[str, Any]) -> str:
        ends = row["interval"]
        return f"{row[name]:.3f}" + (" [{:.3f}, {:.3f}]".format(*ends[name]) if ends else "")

    return text


def _word(name: str) -> Cell:
    return lambda row: str(row[name])


COLUMNS: dict[str, Cell] = {
    name: _word(name) for name in ("perception", "furniture", "rooms", "pictures")
} | {name: _figure(name) for name in FIGURES}


@dataclass(frozen=True)
class RenderedOptions:
    """Judge perception networks on rendered pictures with labels."""

    data: Path
    """Folder of picture sets (cfnav rooms make --views N)."""
    perception: tuple[Path, ...] = ()
    """ONNX files of perception networks; the shipped bundle's when absent."""
    out: Path = Path("out/eyes/rendered.json")
    """File of the results."""


Scores = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Of "shown" and "near", float [N, C], and what is true, bool [N, C]."""


def scores(network: OnnxPerception, folder: Path) -> Scores:
    """What a network says of a room's pictures, and what is true.

    Raises:
        ValueError: the set is damaged or of another camera, or the network does not detect as the
            built-in one does.
    """
    pictures, gives = PictureSet.load(folder), network.gives
    if gives.size != pictures.pictures.shape[1:3] or gives.camera not in (None, pictures.camera):
        raise ValueError(
            f"found pictures of {pictures.camera} in {folder}, expected those of {gives.camera}, "
            f"{gives.size[1]} x {gives.size[0]} pixels; give a network of this camera"
        )
    if set(gives.objects) != set(CATEGORIES):
        raise ValueError(
            f"found a network that knows {', '.join(gives.objects)}, expected the "
            f"{len(CATEGORIES)} categories of {folder}; give another"
        )
    at = columns(gives.fields)
    order = [gives.objects.index(name) for name in CATEGORIES]
    found = network(np.asarray(pictures.pictures)).detections.astype(np.float32)[:, order]
    return (
        found[:, :, at["score"].start], found[:, :, at["near"].start],
        shown_in(pictures.heat), np.asarray(pictures.visible),
    )  # fmt: skip


def judged(rooms: list[Scores], seed: int = 0) -> dict[str, object]:
    """Figures over all pictures, each with an interval of 95 % over rooms, where these are enough.

    Every draw of rooms is judged by the categories that count in all of them together.
    """
    is_shown, is_near = (np.concatenate([room[k] for room in rooms]) for k in (2, 3))
    among = counted(is_shown), counted(is_near)

    def over(index: np.ndarray) -> dict[str, Any]:
        shown, near, is_shown, is_near = (
            np.concatenate(column) for column in zip(*(rooms[k] for k in index), strict=True)
        )
        return agreement(shown, near, is_shown, is_near, among)

    def figures(index: np.ndarray) -> list[float]:
        said = over(index)
        return [said[name] for name in FIGURES]

    ends = None
    if len(rooms) >= FEW:
        drawn = intervals(figures, len(rooms), seed, SAMPLES)
        ends = dict(zip(FIGURES, drawn, strict=True))
    counts = {"rooms": len(rooms), "pictures": sum(len(room[0]) for room in rooms)}
    return {**counts, **over(np.arange(len(rooms))), "interval": ends}


def near_recall(rooms: Sequence[Scores], pixels: Sequence[np.ndarray]) -> list[dict[str, Any]]:
    """How many of the visible things are said to be near, at 0.5, by how large they are seen.

    Args:
        rooms: see ``scores``.
        pixels: for each room how many times as many as it must have each thing has, float [N, C].

    Returns:
        For each class of ``TIMES`` its ``things``, and ``recall``, None where there are none.
    """
    near, is_near = (np.concatenate([room[k] for room in rooms]) for k in (1, 3))
    times = np.concatenate(pixels)
    found = []
    for least, most in zip(TIMES, (*TIMES[1:], np.inf), strict=True):
        its = is_near & (times >= least) & (times < most)
        recall = float((near[its] > 0.5).mean()) if its.any() else None
        found.append({"times": least, "things": int(its.sum()), "recall": recall})
    return found


def times_visible(folder: Path) -> np.ndarray:
    """How many times as many pixels as visible things must have those of a room's pictures have.

    Returns:
        float [N, C], of all things of a category together; 0 of what is not visible.
    """
    pictures = PictureSet.load(folder)
    return np.asarray(pictures.near).sum((1, 2), dtype=np.int64) / least_pixels(pictures.camera)


def by_pixels(found: Sequence[dict[str, Any]]) -> str:
    """Recall of "near" by how large things are seen, a column for each line of figures."""

    def recall(of: list[dict[str, Any]]) -> Cell:
        def text(k: int) -> str:
            value = of[k]["recall"]
            return "" if value is None else f"{value:.2f} of {of[k]['things']:,}"

        return text

    def times(k: int) -> str:
        return f"{TIMES[k]} to {TIMES[k + 1]}" if k + 1 < len(TIMES) else f"{TIMES[k]} and more"

    columns: dict[str, Cell] = {"times as many pixels as visible things must have": times} | {
        f"{said['perception']}, {said['furniture']}": recall(said["near_recall"]) for said in found
    }
    return table(columns, range(len(TIMES)))


def by_category(found: Sequence[dict[str, Any]]) -> str:
    """AUC of "shown" of every category that counts somewhere, a column for each line of figures."""

    def auc(of: dict[str, float]) -> Cell:
        return lambda name: f"{of[name]:.2f}" if name in of else ""

    columns = {"AUC of shown": str} | {
        f"{said['perception']}, {said['furniture']}": auc(said["shown_auc_by_category"])
        for said in found
    }
    names = {name for said in found for name in said["shown_auc_by_category"]}
    return table(columns, sorted(names))


def main(options: RenderedOptions) -> None:
    """Judge, print a table and write the figures.

    Raises:
        ValueError: there is no set, or a network or set does not fit.
    """
    rooms = rooms_in(options.data, HEAD)
    if not rooms:
        raise ValueError(
            f"found no picture set in {options.data}; make some with cfnav rooms make --views 200"
        )
    by_furniture: dict[str, list[Path]] = {}
    for kind, seed in rooms:
        folder = room_folder(options.data, kind, seed)
        by_furniture.setdefault(furniture_of(kind), []).append(folder)
    found = []
    for path in options.perception or (shipped_perception(),):
        network = OnnxPerception(path)
        for furniture, sets in by_furniture.items():
            rooms_said = [scores(network, folder) for folder in sets]
            found.append({
                "perception": network.identity, "furniture": furniture, **judged(rooms_said),
                "near_recall": near_recall(rooms_said, [times_visible(folder) for folder in sets]),
            })  # fmt: skip
    print(table(COLUMNS, found))
    print(by_pixels(found))
    print(by_category(found))
    write_json(options.out, {"command": command_line(), "commit": commit(), "networks": found})


if __name__ == "__main__":
    sys.exit(run_options("rendered", RenderedOptions, main))
