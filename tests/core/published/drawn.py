"""A small room drawn by hand, and a writer of the published files that shares no code with them.

Six places, x to the right and z up, in steps of 0.25 m; the origin is B:

    . D E
    A B C
    . F .

Every place has 8 rotations and 2 horizons. The diagonal A to D is blocked although D is free. B to
F has an edge, F to B has none. E facing 90 cannot turn right.
"""

from __future__ import annotations

import json
import zlib
from pathlib import Path

import h5py
import networkx as nx
import numpy as np

PLACES = {
    "A": (-0.25, 0.0), "B": (0.0, 0.0), "C": (0.25, 0.0),
    "D": (0.0, 0.25), "E": (0.25, 0.25), "F": (0.0, -0.25),
}  # fmt: skip
NO_WAY = {("A", 45), ("F", 0)}
NO_RIGHT_TURN = ("E", 90)

# who sees what, by place, rotation and horizon
LAPTOP = [("D", 90, 0), ("E", 90, 0)]
SINK, BASIN = [("C", 180, 30)], [("C", 180, 30), ("C", 135, 30)]
OBJECTS = {
    "Laptop|+01.25|+00.85|+00.25": LAPTOP,
    "Sink|+00.25|+00.93|-00.50|SinkBasin": BASIN,
    "Sink|+00.25|+00.90|-00.75": SINK,
    "Toaster|-01.00|+00.90|+00.00": [],
    "Floor|+00.00|+00.00|+00.00": [("B", 0, 30)],
}

SIXTY = """AlarmClock, Bed, Blinds, Book, Bowl, Bread, ButterKnife, Cabinet, Candle, CD, CellPhone,
Chair, CoffeeMachine, WineBottle, DeskLamp, DishSponge, Drawer, Dresser, FloorLamp, Fridge,
GarbageCan, HandTowel, Kettle, KeyChain, Knife, Ladle, Laptop, LightSwitch, Microwave, Mirror, Mug,
Painting, Pan, Pen, Pencil, PepperShaker, Pillow, Plate, Pot, RemoteControl, Safe, ScrubBrush, Sink,
SoapBar, SoapBottle, Sofa, Spatula, Spoon, StoveBurner, TeddyBear, Television, TennisRacket,
TissueBox, Toaster, ToiletPaper, Towel, Vase, Watch, WateringCan, Window"""
TWENTY_TWO = """AlarmClock, Book, Bowl, CellPhone, Chair, CoffeeMachine, DeskLamp, FloorLamp,
Fridge, GarbageCan, Kettle, Laptop, LightSwitch, Microwave, Pan, Plate, Pot, RemoteControl, Sink,
StoveBurner, Television, Toaster"""


def names(text: str) -> list[str]:
    return text.replace("\n", " ").replace(" ", "").split(",")


def key(x: float, z: float, rotation: int, horizon: int) -> str:
    """As the published controller writes it, without the minus of a zero."""
    return f"{x + 0.0:.2f}|{z + 0.0:.2f}|{rotation}|{horizon}"


def at(place: str, rotation: int, horizon: int) -> str:
    return key(*PLACES[place], rotation, horizon)


STATES = [at(p, r, h) for p in PLACES for r in range(0, 360, 45) for h in (0, 30)]


def graph() -> nx.DiGraph:
    """The room's edges, one rule after the other."""
    g = nx.DiGraph()
    g.add_nodes_from(STATES)
    for place, (x, z) in PLACES.items():
        for rotation in range(0, 360, 45):
            dx = {0: 0, 45: 1, 90: 1, 135: 1, 180: 0, 225: -1, 270: -1, 315: -1}[rotation]
            dz = {0: 1, 45: 1, 90: 0, 135: -1, 180: -1, 225: -1, 270: 0, 315: 1}[rotation]
            for horizon in (0, 30):
                here = at(place, rotation, horizon)
                ahead = key(x + 0.25 * dx, z + 0.25 * dz, rotation, horizon)
                if ahead in STATES and (place, rotation) not in NO_WAY:
                    g.add_edge(here, ahead)
                g.add_edge(here, at(place, (rotation - 45) % 360, horizon))
                if (place, rotation) != NO_RIGHT_TURN:
                    g.add_edge(here, at(place, (rotation + 45) % 360, horizon))
                g.add_edge(here, at(place, rotation, 30 - horizon))
    return g


def numbers(shape: tuple[int, ...], *of: str) -> np.ndarray:
    """float32 numbers that belong to a state, and to nothing else; mostly one number throughout."""
    seed = zlib.crc32(" ".join(of).encode())
    if "|135|" not in of[0]:
        return np.full(shape, seed / 2**32, "f4")
    return np.random.default_rng(seed).normal(size=shape).astype("f4")


def table(state: str, classes: str) -> np.ndarray:
    return np.stack([numbers((517,), state, name) for name in names(classes)])


BOXES = {"Laptop": [30, 60, 90, 120, 150, 0, 210, 30], "Wall": [0, 0, 300, 300], "Mug": []}


def write_graph(path: Path, edges: str = "links", undirected: bool = False) -> None:
    g = graph().to_undirected() if undirected else graph()
    path.write_text(json.dumps(nx.node_link_data(g, edges=edges)))


def write_states(path: Path, of, states=STATES, minus_zero: bool = False) -> None:
    with h5py.File(path, "w") as file:
        for state in states:
            spelled = "-" + state if minus_zero and state.startswith("0.00") else state
            data = of(state)
            if (data == data.flat[0]).all():  # takes no room on the disk
                file.create_dataset(spelled, data.shape, data.dtype, fillvalue=data.flat[0])
            else:
                file.create_dataset(spelled, data=data)


def write_visible(path: Path, by_state: bool = False) -> None:
    seen = {name: [at(*s) for s in states] for name, states in OBJECTS.items()}
    if by_state:
        seen = {
            state: {"objects": [
                {"objectId": name, "objectType": name.split("|")[0], "visible": state in states}
                for name, states in seen.items()
            ]}
            for state in STATES
        }  # fmt: skip
    path.write_text(json.dumps(seen))


def write_boxes(path: Path) -> None:
    boxes = {state: {} for state in STATES}
    for place in LAPTOP:
        boxes[at(*place)] = BOXES
    path.write_text(json.dumps(boxes))


def write_common(folder: Path, visible: str, shape=(512, 7, 7), **quirks) -> None:
    folder.mkdir(parents=True)
    grid = [{"x": x, "y": 0.9, "z": z} for x, z in PLACES.values()]
    (folder / "grid.json").write_text(json.dumps(grid))
    write_graph(folder / "graph.json", quirks.get("edges", "links"))
    write_visible(folder / visible, quirks.get("by_state", False))
    write_states(
        folder / "resnet18_featuremap.hdf5", lambda state: numbers(shape, state),
        minus_zero=quirks.get("minus_zero", False),
    )  # fmt: skip


def write_data1(folder: Path, file="det_feature_22_cates.hdf5", classes=TWENTY_TWO, **quirks):
    write_common(folder, "visible_object_map_1.5.json", (1, 512, 7, 7), **quirks)
    write_states(folder / file, lambda state: table(state, classes))


def write_data2(folder: Path, **quirks):
    write_common(folder, "visible_object_map.json", **quirks)
    write_boxes(folder / "objects_bb.json")


def write_savn(folder: Path, **quirks):
    write_common(folder, "visible_object_map.json", (1, 512, 7, 7), **quirks)
