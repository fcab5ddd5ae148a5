"""How well boxes fit things in rendered rooms, by the rule: ``python -m studies.eyes.boxes``.

Each rule makes the boxes of the same pictures; the truth is what the renderer says that each pixel
belongs to. A rule is chosen in ``--rooms`` and told of in ``--other-rooms``. A network that was
exported before it gave maps is given them first, which changes no number of it; ``--with-maps``
keeps that file.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import onnx

from cfnav_core.command import command_line, run_options
from cfnav_core.files.json_file import write_json
from cfnav_core.files.provenance import commit, sha256
from cfnav_core.perception.boxes import LEAST, SHARE, Box, decode
from cfnav_core.perception.perception import MAPS, OnnxPerception
from cfnav_core.perception.sight import cells
from cfnav_core.policy.bundle import shipped_perception
from cfnav_core.task.camera import MAST
from cfnav_core.task.visibility import least_pixels
from cfnav_core.task.vocabulary import ROOM_TYPES
from studies.engine.pages import table
from studies.eyes.detectors import overlap, paired
from studies.eyes.rooms import boxes_of, views_of_rooms

FITS = 0.5
"""Intersection through union from which a box is that of a thing."""

SHARES = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)


@dataclass(frozen=True)
class BoxOptions:
    """Measure the boxes of a perception network in rendered rooms."""

    perception: Path | None = None
    """The built-in network's ONNX file; the shipped bundle's when absent."""
    rooms: tuple[str, ...] = tuple(f"{kind}:20-23" for kind in ROOM_TYPES)
    """TYPE:SEED or TYPE:FIRST-LAST, to choose a rule in."""
    other_rooms: tuple[str, ...] = tuple(f"{kind}:24-27" for kind in ROOM_TYPES)
    """Rooms in which it was not chosen."""
    views: int = 16
    """Random views a room."""
    with_maps: Path | None = None
    """Keep the network with maps here."""
    json: Path | None = None
    """Also write the figures here."""


@dataclass(frozen=True)
class View:
    """A picture as the network sees it, and what is in it.

    Attributes:
        shown: float32 [C, *Q], the network's maps.
        things: names and boxes, and whether a thing is large enough to be asked for.
    """

    shown: np.ndarray
    things: tuple[tuple[str, Box, bool], ...]


@dataclass(frozen=True)
class Fit:
    """How boxes fit things.

    Attributes:
        mean_iou: of each box of a category that is in the picture with the thing that it fits best.
        boxes, things: how many there are.
        pairs: of a box and a thing that fit, each taken once.
    """

    mean_iou: float
    boxes: int
    things: int
    pairs: int

    @property
    def right(self) -> float:
        """Share of the boxes that fit."""
        return self.pairs / max(self.boxes, 1)

    @property
    def found(self) -> float:
        """Share of the things that a box fits."""
        return self.pairs / max(self.things, 1)


def give_maps(path: Path, out: Path) -> None:
    """Write the built-in network with its maps of where things are as an output.

    Raises:
        ValueError: it is another network.
    """
    network = onnx.load(path)
    # the maps are the first thing that is made a probability
    made = next((n.output[0] for n in network.graph.node if n.op_type == "Sigmoid"), None)
    if made is None:
        raise ValueError(f"found no maps in {path}, expected a network of cfnav perception")
    network.graph.node.append(onnx.helper.make_node("Identity", [made], [MAPS]))
    gives = OnnxPerception(path).gives
    shape: list[str | int] = ["n", len(gives.objects), *cells(*gives.size)]
    network.graph.output.append(
        onnx.helper.make_tensor_value_info(MAPS, onnx.TensorProto.FLOAT, shape)
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    onnx.save(network, out)


def views_of(rooms: Sequence[str], count: int, network: OnnxPerception) -> list[View]:
    """Random views of rooms by the network's camera.

    Raises:
        ValueError: rooms that do not exist here.
    """
    out = []
    for _, picture, names in views_of_rooms(rooms, count, network.gives.camera or MAST):
        least = least_pixels(network.gives.camera or MAST)
        things = boxes_of(picture.owner, names)
        out.append(View(
            network.maps(picture.rgb), tuple((name, box, n >= least) for name, box, n in things)
        ))  # fmt: skip
    return out


def fit(views: Sequence[View], network: OnnxPerception, share: float, between_cells: bool) -> Fit:
    """How the boxes of a rule fit."""
    gives, best, boxes, things, pairs = network.gives, [], 0, 0, 0
    camera = gives.camera or MAST
    for view in views:
        found = decode(
            view.shown, gives.objects, gives.size, camera.size, LEAST, share, between_cells
        )
        for name in gives.objects:
            mine = np.array([one.box for one in found if one.name == name]).reshape(-1, 4)
            there = [(box, large) for thing, box, large in view.things if thing == name]
            boxes, things = boxes + len(mine), things + sum(large for _, large in there)
            if not len(mine) or not there:
                continue
            shared = np.stack([overlap(np.array(box), mine) for box, _ in there])
            best += shared.max(0).tolist()
            pairs += int(paired(shared[[large for _, large in there]], FITS).sum())
    return Fit(float(np.mean(best)), boxes, things, pairs)


def run(options: BoxOptions, folder: Path) -> dict[str, list[Fit]]:
    """Fits of each rule by its name: in the rooms to choose in, and in the others.

    Args:
        options: what to measure.
        folder: for files on the way.

    Raises:
        ValueError: the network or rooms cannot be used.
    """
    path = options.perception or shipped_perception()
    network = OnnxPerception(path)
    if network.no_boxes:
        with_maps = options.with_maps or folder / path.name
        give_maps(path, with_maps)
        network = OnnxPerception(with_maps)
    halves = [views_of(r, options.views, network) for r in (options.rooms, options.other_rooms)]
    return {
        f"{share}, {'between cells' if between else 'at cells'}": [
            fit(views, network, share, between) for views in halves
        ]
        for between in (False, True)
        for share in SHARES
    }


def main(options: BoxOptions) -> None:
    """Measure and print a table."""
    with TemporaryDirectory() as folder:
        fits = run(options, Path(folder))

    def figure(half: int, name: str) -> Callable[[tuple[str, list[Fit]]], str]:
        return lambda row: f"{getattr(row[1][half], name):.3f}"

    columns: dict[str, Callable] = {"share, edges": lambda row: row[0]}
    for half, where in enumerate(("", ", other rooms")):
        columns[f"mean IoU{where}"] = figure(half, "mean_iou")
        columns[f"boxes that fit{where}"] = figure(half, "right")
        columns[f"things found{where}"] = figure(half, "found")
    print(table(columns, list(fits.items())))
    if options.json is not None:
        write_json(options.json, {
            "command": command_line(), "commit": commit(), "shipped_share": SHARE,
            "network": sha256(options.perception or shipped_perception()),
            "fits": {name: [asdict(one) for one in both] for name, both in fits.items()},
        })  # fmt: skip


if __name__ == "__main__":
    sys.exit(run_options("boxes", BoxOptions, main))
