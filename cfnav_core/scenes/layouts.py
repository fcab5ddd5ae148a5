"""The three published data sets: folders, files, object lists, targets and splits, as one table.

Sources: offline AI2-THOR data of SAVN (Wortsman et al. 2019), Offline Data 1 (Zhang et al. 2021,
HOZ) and Offline Data 2 (Pal et al. 2020, MJOLNIR).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from cfnav_core.scenes.scene import SceneError
from cfnav_core.task.rooms import SPLITS
from cfnav_core.task.vocabulary import DATA1_TARGETS, DATA2_TARGETS, ROOM_TYPES

FIRST_NUMBER = {"kitchen": 0, "living_room": 200, "bedroom": 300, "bathroom": 400}
"""FloorPlan numbers of a room type are these plus 1 to 30."""

SUFFIX = "_physics"
"""Some sets write it behind some scene names; names here are always without it."""


DETECTOR_OBJECTS = (
    "AlarmClock", "Bed", "Blinds", "Book", "Bowl", "Bread", "ButterKnife", "Cabinet", "Candle",
    "CD", "CellPhone", "Chair", "CoffeeMachine", "WineBottle", "DeskLamp", "DishSponge", "Drawer",
    "Dresser", "FloorLamp", "Fridge", "GarbageCan", "HandTowel", "Kettle", "KeyChain", "Knife",
    "Ladle", "Laptop", "LightSwitch", "Microwave", "Mirror", "Mug", "Painting", "Pan", "Pen",
    "Pencil", "PepperShaker", "Pillow", "Plate", "Pot", "RemoteControl", "Safe", "ScrubBrush",
    "Sink", "SoapBar", "SoapBottle", "Sofa", "Spatula", "Spoon", "StoveBurner", "TeddyBear",
    "Television", "TennisRacket", "TissueBox", "Toaster", "ToiletPaper", "Towel", "Vase", "Watch",
    "WateringCan", "Window",
)  # fmt: skip
"""Rows of the older detector tables of Offline Data 1, those with 60 rows."""

DATA2_OBJECTS = (
    "AlarmClock", "Apple", "ArmChair", "BaseballBat", "BasketBall", "Bathtub", "Bed", "Blinds",
    "Book", "Boots", "Bowl", "Box", "Bread", "ButterKnife", "CD", "Cabinet", "Candle", "Cart",
    "CellPhone", "Chair", "Cloth", "CoffeeMachine", "CounterTop", "CreditCard", "Cup", "Curtains",
    "Desk", "DeskLamp", "DishSponge", "Drawer", "Dresser", "Egg", "FloorLamp", "Footstool", "Fork",
    "Fridge", "GarbageCan", "Glassbottle", "HandTowel", "HousePlant", "Kettle", "KeyChain", "Knife",
    "Ladle", "Lamp", "Laptop", "Lettuce", "LightSwitch", "Microwave", "Mirror", "Mug", "Newspaper",
    "NightStand", "Ottoman", "Painting", "Pan", "PaperTowelRoll", "Pen", "Pencil", "PepperShaker",
    "Pillow", "Plate", "Plunger", "Poster", "Pot", "Potato", "RemoteControl", "Safe", "SaltShaker",
    "ScrubBrush", "Shelf", "ShowerDoor", "ShowerGlass", "Sink", "SinkBasin", "SoapBar",
    "SoapBottle", "Sofa", "Spatula", "Spoon", "SprayBottle", "Statue", "StoveBurner", "StoveKnob",
    "TableTop", "TeddyBear", "Television", "TennisRacket", "TissueBox", "Toaster", "Toilet",
    "ToiletPaper", "ToiletPaperRoll", "Tomato", "Towel", "TowelHolder", "Vase", "Watch",
    "WateringCan", "Window", "WineBottle",
)  # fmt: skip
"""The 101 objects of Offline Data 2, for when its own objects.txt is not there."""

SAVN_TARGETS = {
    "kitchen": ("Toaster", "Microwave", "Fridge", "CoffeeMaker", "GarbageCan", "Box", "Bowl"),
    "living_room": ("Pillow", "Laptop", "Television", "GarbageCan", "Box", "Bowl"),
    "bedroom": ("HousePlant", "Lamp", "Book", "AlarmClock"),
    "bathroom": ("Sink", "ToiletPaper", "SoapBottle", "LightSwitch"),
}
"""The targets of SAVN's data by room type."""

SAVN_OBJECTS = tuple(sorted({name for row in SAVN_TARGETS.values() for name in row}))
"""Its 18 distinct targets; it has no detections."""


@dataclass(frozen=True)
class Layout:
    """One published data set.

    Attributes:
        name: identity in stores and on command lines.
        folders: names the folder of the scenes has below the unpacked archive.
        suffixed: room types whose folders end with ``SUFFIX``.
        features: files of picture features, in the order they are looked for.
        detections: detector tables (.hdf5) or true boxes (.json), in that order; none for SAVN.
        visible: visible-object maps, in that order.
        objects: rows of the detections.
        objects_file: the set's own list of objects, beside the scenes' folder.
        targets: what may be asked for in a type of room.
        splits: row of ``rooms.SPLITS``; its seed 0 is room 1 of a type.
        room_types_in_turn: training goes through the room types and draws a room of that type;
            otherwise it draws from all rooms. Either way the target is drawn by the number of its
            instances (``draw.chances``) and the start among all states, made level.
    """

    name: str
    folders: tuple[str, ...]
    suffixed: tuple[str, ...]
    features: tuple[str, ...]
    detections: tuple[str, ...]
    visible: tuple[str, ...]
    objects: tuple[str, ...]
    objects_file: str | None
    targets: Mapping[str, tuple[str, ...]]
    splits: Mapping[str, Sequence[int]]
    room_types_in_turn: bool


_FEATURES = ("resnet18_featuremap.hdf5", "clip_featuremap.hdf5")

LAYOUTS: Mapping[str, Layout] = MappingProxyType({
    "data1": Layout(
        name="data1", folders=("Scene_Data", "AI2thor_offline_data"), suffixed=(),
        features=_FEATURES,
        detections=("det_feature_22_cates.hdf5", "det_feature_60_categories.hdf5",
                    "det_feature_categories.hdf5"),
        visible=("visible_object_map_1.5.json", "visible_object_map.json"),
        objects=DATA1_TARGETS, objects_file=None,
        targets=dict.fromkeys(ROOM_TYPES, DATA1_TARGETS),
        splits=SPLITS["data1"], room_types_in_turn=False,
    ),
    "data2": Layout(
        name="data2", folders=("thor_v1_offline_data", "data/thor_v1_offline_data"), suffixed=(),
        features=_FEATURES, detections=("objects_bb.json",),
        visible=("visible_object_map.json", "visible_object_map_1.5.json"),
        objects=DATA2_OBJECTS, objects_file="gcn/objects.txt", targets=DATA2_TARGETS,
        splits=SPLITS["data2"], room_types_in_turn=True,
    ),
    "savn": Layout(
        name="savn", folders=("thor_offline_data", "data/thor_offline_data"),
        suffixed=("kitchen", "living_room"), features=_FEATURES, detections=(),
        visible=("visible_object_map.json", "metadata.json"),
        objects=SAVN_OBJECTS, objects_file=None, targets=SAVN_TARGETS,
        splits=SPLITS["data1"], room_types_in_turn=True,
    ),
})  # fmt: skip


@dataclass(frozen=True)
class SceneFolder:
    """One scene of a data set on disk; ``split`` is train, validation or test."""

    name: str
    room_type: str
    split: str
    path: Path


def room_of(name: str) -> tuple[str, int]:
    """Room type and number (1 to 30) of ``FloorPlan7`` or ``FloorPlan7_physics``.

    Raises:
        SceneError: it is no such name.
    """
    found = re.fullmatch(rf"FloorPlan(\d+)(?:{SUFFIX})?", name)
    for kind, first in FIRST_NUMBER.items():
        if found and 1 <= int(found[1]) - first <= 30:
            return kind, int(found[1]) - first
    raise SceneError(f"found scene {name!r}, expected FloorPlan1 to 30, 201, 301 or 401 and so on")


def scene_names(layout: Layout) -> list[tuple[str, str, str]]:
    """Name, room type and split of every scene the data set has."""
    return [
        (f"FloorPlan{first + 1 + seed}", kind, split)
        for kind, first in FIRST_NUMBER.items()
        for seed, split in sorted((n, s) for s, seeds in layout.splits.items() for n in seeds)
    ]


def scene_folders(root: Path, layout: Layout) -> list[SceneFolder]:
    """The scenes below ``root`` (see ``scenes_root``), in the order of the table."""
    out = []
    for name, kind, split in scene_names(layout):
        plain, suffixed = root / name, root / (name + SUFFIX)
        order = (suffixed, plain) if kind in layout.suffixed else (plain, suffixed)
        path = next((p for p in order if p.is_dir()), None)
        if path is not None:
            out.append(SceneFolder(name, kind, split, path))
    return out


def scenes_root(folder: Path, layout: Layout | None = None) -> Path:
    """The folder that holds the scenes: the given one or one of the published names below it.

    Raises:
        SceneError: there are none.
    """
    names = [n for row in ([layout] if layout else LAYOUTS.values()) for n in row.folders]
    for root in (folder, *(folder / n for n in names)):
        if any(p.is_dir() for p in root.glob("FloorPlan*")):
            return root
    raise SceneError(
        f"found no FloorPlan folders in {folder} or in {', '.join(names)} below it; "
        "name the folder that a published data set was unpacked into"
    )


def recognise(root: Path) -> Layout:
    """Tell the data set from the files of its scenes.

    Raises:
        SceneError: they do not tell, or they tell of more than one.
    """

    def has(pattern: str) -> bool:
        return next(root.glob(f"FloorPlan*{pattern}"), None) is not None

    found = {
        "data1": has("/det_feature_*.hdf5") or has("/detr_feature_*.hdf5"),
        "data2": has("/objects_bb.json"),
    }
    if not any(found.values()):
        found = {"data1": has("/visible_object_map_1.5.json"), "savn": has(SUFFIX)}
    names = [name for name, there in found.items() if there]
    if len(names) != 1:
        raise SceneError(
            f"found files of {' and '.join(names) or 'no one data set'} in {root}; "
            f"say which it is with --layout {'|'.join(LAYOUTS)}"
        )
    return LAYOUTS[names[0]]


def objects_of(layout: Layout, root: Path) -> tuple[str, ...]:
    """Rows of the detections: the data set's own list where it lies beside the scenes.

    Raises:
        SceneError: the list lacks a target.
    """
    path = root.parent / layout.objects_file if layout.objects_file else None
    if path is None or not path.exists():
        return layout.objects
    names = tuple(path.read_text().split())
    if missing := sorted({t for row in layout.targets.values() for t in row} - set(names)):
        raise SceneError(f"found no {', '.join(missing)} in {path}, expected every target of "
                         f"{layout.name}; unpack it again")  # fmt: skip
    return names
