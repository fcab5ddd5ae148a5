"""The bathroom: a basin under a mirror, a toilet with its paper, a bath or a shower."""

from __future__ import annotations

from sim_bridge.room import fixtures as fx
from sim_bridge.room import furniture as fu
from sim_bridge.room import objects as ob
from sim_bridge.room.kit import Kit
from sim_bridge.room.parts import Frame
from sim_bridge.room.recipes.common import clutter, hang, rug, stand, tops
from sim_bridge.sweet_home.table import Piece

CLEAR_M = 0.35
"""Free floor before basin and toilet."""
TOPS = ("side", "washing_machine", "stool", "rim", "counter")


def furnish(kit: Kit) -> None:
    """Furnish a bathroom."""
    b = kit.b
    _basin(kit)
    _bath(kit)
    _toilet(kit)
    for role, p in {"bidet": 0.2, "washing_machine": 0.4, "stool": 0.25}.items():
        if b.chance(p):
            kit.stand(role)
    if b.chance(0.9):
        width, height = float(b.rng.uniform(0.4, 0.7)), float(b.rng.uniform(0.6, 0.9))
        fu.cabinet(b, width, 0.38, height, "side")
    tops(kit, {"SoapBar": 0.9, "SprayBottle": 0.8, "ToiletPaper": 0.5, "Towel": 0.3, "Vase": 0.1,
               "HousePlant": 0.25}, *TOPS)  # fmt: skip
    tops(kit, {"SoapBar": 0.25, "SprayBottle": 0.2}, *TOPS)
    clutter(kit, "clutter_bath", 5, *TOPS)
    stand(kit, {"GarbageCan": 0.7, "HousePlant": 0.15})
    hang(kit, {"Towel": 0.95, "LightSwitch": 0.75, "Painting": 0.1})
    hang(kit, {"Towel": 0.3, "ToiletPaper": 0.3, "Mirror": 0.15})
    if b.chance(0.35):
        kit.stand("clutter_floor", fits=lambda piece: "bathroom" in piece.rooms)


def _bath(kit: Kit) -> None:
    """A bathtub, in a corner where it is made for one, and a shower now and then."""
    b = kit.b
    bath = b.chance(0.6)
    if bath:
        tub = kit.pick("bathtub", lambda piece: piece.kind != "corner")
        if tub is not None and b.chance(0.6):
            width, depth, height = tub.entry.size
            frame = b.place(width, depth, height=height)
            if frame is not None:
                kit.add(tub, frame)
                b.occupy_wall(frame, width, 0, height)
                _mat(kit, frame.at(0, depth))
        else:
            fx.bathtub(b)
    if b.chance(0.15 if bath else 0.8):
        kit.stand("shower", fits=lambda piece: piece.kind == "stall")


def _mat(kit: Kit, before: Frame) -> None:
    mat = kit.pick("rug", lambda piece: "bathroom" in piece.rooms)
    if mat is not None and kit.b.chance(0.6):
        kit.add(mat, before.at(0, 0.05))
    elif kit.b.chance(0.5):
        rug(kit, before.at(0, 0.4), large=False)


def _basin(kit: Kit) -> None:
    """A washbasin, or a vanity, or one of our own counters, under a mirror."""
    b = kit.b
    if b.chance(0.3):
        width = float(b.rng.uniform(0.8, 1.4))
        frame = fx.counter(b, width, 0.52)
        if frame is None:
            return
        ob.put(b, "Sink", ("counter",))
    else:
        basin = kit.pick("Sink", lambda piece: piece.kind in ("pedestal", "wall", "unit"))
        if basin is None:
            return
        frame = _stand_basin(kit, basin)
        if frame is None:
            return
    if b.chance(0.85):
        kit.hang("Mirror", frame.at(0, -0.01))
    if b.chance(0.4):
        _mat(kit, frame.at(0, 0.55))


def _stand_basin(kit: Kit, basin: Piece) -> Frame | None:
    width, depth, height = basin.entry.size
    width, depth = width + 0.2, depth + CLEAR_M
    frame = kit.b.place(width, depth, height=1.9) or kit.b.place(width, depth, height=1.0)
    if frame is None:
        return None
    kit.add(basin, frame.at(0, 0, basin.entry.elevation))
    kit.b.occupy_wall(frame, width, 0, min(basin.entry.elevation + height, 1.05))
    return frame


def _toilet(kit: Kit) -> None:
    b = kit.b
    found = kit.stand("toilet", clear=CLEAR_M) if b.chance(0.85) else None
    if found is None:
        fx.toilet(b)
        return
    piece, frame = found
    side = 1.0 if b.chance(0.5) else -1.0
    if b.chance(0.75):
        kit.hang("ToiletPaper", frame.at(side * (piece.entry.size[0] / 2 + 0.28), -0.01))
