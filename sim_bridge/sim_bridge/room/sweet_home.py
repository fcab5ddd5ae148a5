"""Rooms furnished with Sweet Home 3D's models, as people furnish theirs.

What belongs together stands together: a low table and armchairs before the sofa, which faces the
television; night stands beside the bed; kitchen units in a row; chairs at tables.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from sim_bridge.room import furniture as fu
from sim_bridge.room import objects as ob
from sim_bridge.room.kit import Kit
from sim_bridge.room.parts import Builder, Frame, Surface, hsv
from sim_bridge.room.shell import WALL_HEIGHT, walls
from sim_bridge.sweet_home.table import Piece

FLOORS = {
    "kitchen": ("tile", "tile", "checker", "planks"),
    "living_room": ("planks", "planks", "carpet", "tile"),
    "bedroom": ("planks", "planks", "carpet"),
    "bathroom": ("tile", "tile", "checker"),
}
TABLE_TOPS = ("dining_table", "low_table", "side_table", "sideboard", "dresser", "desk")
WORKTOPS = ("kitchen_base", "counter")


def shell(b: Builder, room_type: str) -> str:
    """Walls, a chimney breast or a recess now and then, floor and ceiling; the floor's texture."""
    walls(b, tiled=room_type == "bathroom" and b.chance(0.6))
    if b.chance(0.35):
        _corner(b)
    kinds = FLOORS[room_type]
    return kinds[int(b.rng.integers(len(kinds)))]


def _corner(b: Builder) -> None:
    """A corner that is no part of the room, which is L-shaped then."""
    w, d = float(b.rng.uniform(0.5, 0.3 * b.width)), float(b.rng.uniform(0.5, 0.3 * b.depth))
    x = w / 2 if b.chance(0.5) else b.width - w / 2
    y = d / 2 if b.chance(0.5) else b.depth - d / 2
    wall = next(part for part in b.parts if b.objects[part.owner].name == "Wall")
    b.add(wall.owner, "box", Frame(x, y), (0, 0, WALL_HEIGHT / 2), (w / 2, d / 2, WALL_HEIGHT / 2),
          wall.colour, wall.texture, wall.repeat)  # fmt: skip
    b.taken.append((x, y, w / 2, d / 2, 0.0))
    for k, (u, size) in enumerate(((x, w), (x, w), (y, d), (y, d))):
        at_wall = (y < b.depth / 2, y > b.depth / 2, x < b.width / 2, x > b.width / 2)[k]
        if at_wall:
            b.walls_taken.append((k, u, size, 0.0, WALL_HEIGHT))


def furnish(b: Builder, room_type: str, held_out: bool) -> None:
    """Put the furniture of a type of room, its goals and its clutter into a shell.

    Args:
        b: with a shell in it.
        room_type: one of ``cfnav_core.task.vocabulary.ROOM_TYPES``.
        held_out: whether the room has the models that only test rooms have.

    Raises:
        SweetHomeError: the furniture is not installed.
    """
    kit = Kit(b, room_type, held_out)
    _door(kit)
    for _ in range(int(b.rng.integers(1, 3))):
        _window(kit)
    RECIPES[room_type](kit)
    _ceiling_lamp(kit)
    if b.chance(0.5):
        kit.stand("radiator")
    for _ in range(int(b.rng.integers(0, 4))):
        kit.stand("clutter_floor", wall=b.chance(0.8), fits=_on_floor)
    for role, p in {"wall_socket": 0.8, "clutter_wall": 0.3, "wall_lamp": 0.3, "clock_wall": 0.15}.items():
        if b.chance(p):
            kit.hang(role)


def _on_floor(piece: Piece) -> bool:
    return not piece.wall and (not piece.on or "floor" in piece.on)


def _door(kit: Kit) -> None:
    piece = kit.pick("door")
    assert piece is not None
    width, depth, height = piece.entry.size
    frame = kit.b.wall_spot(width, 0.0, height)
    if frame is None:
        return
    # its swing stays free
    kit.b.take(frame, width, 0.8)
    kit.add(piece, frame.at(0, 0.03 - depth))


def _window(kit: Kit) -> None:
    """A window in its wall: the view, then the frame before it, then curtains or blinds."""
    b, piece = kit.b, kit.pick("window", lambda piece: piece.kind != "french")
    assert piece is not None
    width, depth, height = piece.entry.size
    low = min(piece.entry.elevation or 0.9, WALL_HEIGHT - 0.1 - height)
    frame = b.wall_spot(width + 0.3, low, low + height)
    if frame is None:
        return
    b.add(b.new("Window"), "box", frame, (0, 0.004, low + height / 2),
          (width / 2 - 0.03, 0.004, height / 2 - 0.03), (1, 1, 1), "window_view", solid=False,
          emission=float(b.rng.uniform(0.35, 0.8)))  # fmt: skip
    kit.add(piece, frame.at(0, 0.05 - depth, low))
    if b.chance(0.25):
        blinds = b.new("Blinds")
        colour = hsv(float(b.rng.random()), 0.1, float(b.rng.uniform(0.75, 0.98)))
        drop = float(b.rng.uniform(0.4, 1.0)) * height / 2
        b.add(blinds, "box", frame, (0, 0.075, low + height - drop), (width / 2 + 0.04, 0.012, drop),
              colour, "slats", solid=False)  # fmt: skip
    elif b.chance(0.5):
        colour = hsv(float(b.rng.random()), float(b.rng.uniform(0.0, 0.5)), float(b.rng.uniform(0.5, 0.95)))
        owner = b.new("Curtain")
        for side in (-1, 1):
            b.add(owner, "box", frame, (side * (width / 2 + 0.08), 0.09, 1.2), (0.16, 0.03, 1.1),
                  colour, "fabric", 0.35, solid=False)  # fmt: skip


def _ceiling_lamp(kit: Kit) -> None:
    piece = kit.pick("ceiling_lamp")
    if piece is None:
        return
    height = piece.entry.size[2]
    x, y = kit.b.width / 2, kit.b.depth / 2
    kit.add(piece, Frame(x, y - piece.entry.size[1] / 2, WALL_HEIGHT - height))


def _tops(kit: Kit, chances: dict[str, float], *kinds: str) -> None:
    for category, p in chances.items():
        if kit.b.chance(p):
            kit.top(category, kinds)


def _walls(kit: Kit, chances: dict[str, float]) -> None:
    for category, p in chances.items():
        if kit.b.chance(p):
            kit.hang(category)


def _clutter(kit: Kit, role: str, most: int, *kinds: str) -> None:
    for _ in range(int(kit.b.rng.integers(0, most + 1))):
        kit.top(role, kinds)


def _table_with_chairs(kit: Kit, most: int) -> Frame | None:
    """A table free in the room with chairs of one kind at its sides."""
    b, table, chair = kit.b, kit.pick("dining_table", lambda p: p.kind != "bar"), kit.pick("Chair")
    assert table is not None and chair is not None
    width, depth, _ = table.entry.size
    back = b.place(width, depth, wall=False, gap=0.55)
    if back is None:
        return None
    kit.add(table, back)
    _, seat, _ = chair.entry.size
    tucked = float(b.rng.uniform(0.1, 0.3))
    middle = back.at(0, depth / 2)
    sides = [(0.0, depth), (math.pi, depth), (math.pi / 2, width), (-math.pi / 2, width)]
    for k in b.rng.permutation(4)[: int(b.rng.integers(1, most + 1))]:
        yaw, across = sides[int(k)]
        # the chair looks at the table: its back edge is the far one
        at = middle.at(0, 0, 0, yaw).at(0, across / 2 + seat - tucked).at(0, 0, 0, math.pi)
        if 0.3 < at.x < b.width - 0.3 and 0.3 < at.y < b.depth - 0.3:
            kit.add(chair, at, float(b.rng.uniform(-0.25, 0.25)))
    return back


def _living_room(kit: Kit) -> None:
    b = kit.b
    sofa = kit.pick("sofa")
    assert sofa is not None
    frame = b.place(sofa.entry.size[0], sofa.entry.size[1])
    if frame is not None:
        kit.add(sofa, frame)
        b.occupy_wall(frame, sofa.entry.size[0], 0, sofa.entry.size[2])
        _around_sofa(kit, frame, sofa)
    _television(kit)
    if b.chance(0.6):
        _table_with_chairs(kit, 4)
    if b.chance(0.7):
        kit.stand("bookcase") or fu.bookshelf(b)
    if b.chance(0.5):
        kit.stand("sideboard")
    if b.chance(0.5):
        fu.cabinet(b, float(b.rng.uniform(0.7, 1.2)), 0.42, float(b.rng.uniform(0.7, 0.9)), "sideboard")
    for role, p in (("fireplace", 0.12), ("piano", 0.12)):
        if b.chance(p):
            kit.stand(role)
    kit.floor("FloorLamp") if b.chance(0.75) else None
    for _ in range(int(b.rng.integers(0, 3))):
        kit.floor("HousePlant")
    kit.floor("GarbageCan") if b.chance(0.4) else None
    _tops(kit, {"RemoteControl": 0.9, "Laptop": 0.8, "Vase": 0.9, "Book": 0.7, "CellPhone": 0.4,
                "Bowl": 0.4, "Plate": 0.25, "Mug": 0.4, "DeskLamp": 0.5, "HousePlant": 0.3,
                "AlarmClock": 0.1, "Painting": 0.2}, *TABLE_TOPS, "tv_stand")  # fmt: skip
    _clutter(kit, "clutter_top", 4, *TABLE_TOPS, "tv_stand")
    _tops(kit, {"Pillow": 0.7}, "seat")
    _walls(kit, {"Painting": 0.95, "LightSwitch": 0.8})
    if b.chance(0.5):
        _walls(kit, {"Painting": 1.0})


def _around_sofa(kit: Kit, frame: Frame, sofa: Piece) -> None:
    """A low table before it on a rug, an armchair beside that, a small table or lamp at its end."""
    b = kit.b
    width, depth, _ = sofa.entry.size
    table = kit.pick("low_table")
    if table is not None and table.entry.size[0] < b.width / 2:
        gap = float(b.rng.uniform(0.35, 0.5))
        at = frame.at(0, depth + gap)
        if kit.beside(table, at) and b.chance(0.6):
            _rug(b, at.at(0, table.entry.size[1] / 2))
        for side in (-1, 1):
            chair = kit.pick("ArmChair")
            if chair is None or not b.chance(0.5):
                continue
            away = table.entry.size[0] / 2 + 0.35 + chair.entry.size[1]
            # its back is away from the table, its front towards it
            back = at.at(side * away, table.entry.size[1] / 2, 0, side * math.pi / 2)
            kit.beside(chair, back)
    for side in (-1, 1):
        end = kit.pick("side_table")
        if end is not None and b.chance(0.4):
            kit.beside(end, frame.at(side * (width / 2 + end.entry.size[0] / 2 + 0.05), 0.02))


def _rug(b: Builder, middle: Frame) -> None:
    w, d = float(b.rng.uniform(0.7, 1.2)), float(b.rng.uniform(0.5, 0.9))
    colour = hsv(float(b.rng.random()), float(b.rng.uniform(0.1, 0.6)), float(b.rng.uniform(0.3, 0.85)))
    b.add(b.new("Rug"), "box", middle, (0, 0, 0.004), (w, d, 0.003), colour, "carpet", 0.7, solid=False)


def _television(kit: Kit) -> None:
    """A stand against a wall with a television on it, or one on the wall above."""
    b = kit.b
    if kit.stand("tv_stand") is None or b.chance(0.3):
        fu.cabinet(b, float(b.rng.uniform(1.2, 1.7)), 0.45, float(b.rng.uniform(0.4, 0.6)), "tv_stand")
    if not kit.top("Television", ("tv_stand", "sideboard")):
        kit.hang("Television")


def _bedroom(kit: Kit) -> None:
    b = kit.b
    bed = kit.pick("bed_double" if b.chance(0.65) else "bed_single", lambda p: p.kind != "bunk")
    assert bed is not None
    width, depth, height = bed.entry.size
    frame = b.place(width, depth)
    if frame is not None:
        kit.add(bed, frame)
        b.occupy_wall(frame, width, 0, max(height, 1.0))
        for side in (-1, 1):
            stand = kit.pick("night_stand")
            if stand is not None and b.chance(0.5):
                kit.beside(stand, frame.at(side * (width / 2 + stand.entry.size[0] / 2 + 0.06), 0.02))
            elif b.chance(0.6):
                _own_night_stand(b, frame, side * width / 2)
        if b.chance(0.5):
            _rug(b, frame.at(float(b.rng.uniform(-0.5, 0.5)) * width, depth + 0.2))
    if b.chance(0.75):
        kit.stand("wardrobe") or fu.wardrobe(b)
    if b.chance(0.5):
        kit.stand("dresser")
    else:
        fu.cabinet(b, float(b.rng.uniform(0.9, 1.4)), 0.5, float(b.rng.uniform(0.75, 0.95)), "dresser")
    _desk(kit)
    if b.chance(0.3):
        kit.stand("ArmChair", wall=False, gap=0.1)
    if b.chance(0.3):
        kit.stand("bookcase") or fu.bookshelf(b)
    _tops(kit, {"Pillow": 0.9}, "bed_head")
    _tops(kit, {"Pillow": 0.4}, "bed_head")
    _tops(kit, {"Laptop": 0.8}, "desk", "dresser")
    _tops(kit, {"AlarmClock": 0.9, "DeskLamp": 0.9, "CD": 0.8, "Book": 0.8, "CellPhone": 0.7,
                "Mug": 0.3, "RemoteControl": 0.2, "Vase": 0.3, "Painting": 0.3, "HousePlant": 0.15},
          "night_stand", "dresser", "desk")  # fmt: skip
    _tops(kit, {"Television": 0.25}, "dresser")
    _clutter(kit, "clutter_top", 3, "night_stand", "dresser", "desk")
    for category, p in {"GarbageCan": 0.6, "HousePlant": 0.4, "FloorLamp": 0.35}.items():
        if b.chance(p):
            kit.floor(category)
    _walls(kit, {"Blinds": 0.6, "LightSwitch": 0.85, "Painting": 0.6, "Mirror": 0.4})


def _own_night_stand(b: Builder, bed: Frame, edge: float) -> None:
    """One of our own night stands at a side of the bed, ``edge`` metres from its middle."""
    w, d, h = (float(b.rng.uniform(*r)) for r in ((0.4, 0.5), (0.38, 0.42), (0.45, 0.6)))
    frame = bed.at(math.copysign(abs(edge) + w / 2 + 0.06, edge), 0.02)
    if not b.take(frame, w, d):
        return
    owner, (colour, texture) = b.new("Cabinet"), b.tone()
    b.add(owner, "box", frame, (0, d / 2, h / 2), (w / 2, d / 2, h / 2), colour, texture, 1)
    b.add(owner, "box", frame, (0, d, h * 0.6), (w / 2 - 0.03, 0.008, h * 0.3), colour, "panel_door")
    b.surfaces.append(Surface(frame.at(0, 0, h), w, d, "night_stand"))


def _desk(kit: Kit) -> None:
    """A desk at the wall and the chair before it."""
    b, desk, chair = kit.b, kit.pick("desk"), kit.pick("Chair")
    assert desk is not None and chair is not None
    width, depth, height = desk.entry.size
    frame = b.place(width, depth)
    if frame is None:
        return
    kit.add(desk, frame)
    b.occupy_wall(frame, width, 0, height + 0.35)
    back = frame.at(0, depth + chair.entry.size[1] - float(b.rng.uniform(0, 0.25)), 0, math.pi)
    if 0.3 < back.x < b.width - 0.3 and 0.3 < back.y < b.depth - 0.3:
        kit.add(chair, back, float(b.rng.uniform(-0.3, 0.3)))


def _kitchen(kit: Kit) -> None:
    b = kit.b
    style = ("oak", "shaker", "")[int(b.rng.integers(3))]
    _row(kit, style, sink=True)
    _row(kit, style, sink=False)
    kit.stand("Fridge")
    if b.chance(0.7):
        _table_with_chairs(kit, 4)
    for role, p in {"oven": 0.25, "washing_machine": 0.2, "bar_stool": 0.3, "sideboard": 0.15}.items():
        if b.chance(p):
            kit.stand(role, wall=role != "bar_stool")
    _tops(kit, {"Pan": 0.8, "Pot": 0.8, "Kettle": 0.4}, "StoveBurner", *WORKTOPS)
    _tops(kit, {"Microwave": 0.8, "CoffeeMachine": 0.85, "Toaster": 0.85, "Kettle": 0.5}, *WORKTOPS)
    _tops(kit, {"Bread": 0.85, "Mug": 0.9, "Apple": 0.9, "Spatula": 0.8, "Bowl": 0.8, "Plate": 0.8,
                "CellPhone": 0.2, "Book": 0.2, "Vase": 0.2}, *WORKTOPS, "dining_table")  # fmt: skip
    _tops(kit, {"Laptop": 0.2, "HousePlant": 0.3, "Mug": 0.4, "Bowl": 0.3}, "dining_table")
    _clutter(kit, "clutter_kitchen", 5, *WORKTOPS, "dining_table")
    for category, p in {"GarbageCan": 0.85, "HousePlant": 0.25}.items():
        if b.chance(p):
            kit.floor(category)
    _walls(kit, {"LightSwitch": 0.9, "Painting": 0.25, "Blinds": 0.15})


def _row(kit: Kit, style: str, sink: bool) -> None:
    """Kitchen units side by side: bases, and the sink or the stove among them; cupboards above."""
    b = kit.b

    def of_style(piece: Piece) -> bool:
        return piece.style == style and piece.kind not in ("island", "corner")

    bases = [kit.pick("kitchen_base", of_style) for _ in range(int(b.rng.integers(1, 4)))]
    special = (
        kit.pick("Sink", lambda p: p.kind == "unit")
        if sink
        else kit.pick("StoveBurner", lambda p: p.kind == "stove")
    )
    units = [unit for unit in bases if unit is not None]
    if special is not None:
        units.insert(int(b.rng.integers(len(units) + 1)), special)
    while units and sum(u.entry.size[0] for u in units) > max(b.width, b.depth) - 0.6:
        units.remove(next((u for u in units if u is not special), units[0]))
    if not units:
        return
    total, depth = sum(u.entry.size[0] for u in units), max(u.entry.size[1] for u in units)
    frame = b.place(total, depth)
    if frame is None:
        return
    b.occupy_wall(frame, total, 0, 1.35)
    uppers = b.chance(0.7)
    x = -total / 2
    for unit in units:
        width = unit.entry.size[0]
        at = frame.at(x + width / 2, 0)
        kit.add(unit, at)
        upper = kit.pick("kitchen_wall", lambda p: p.style == style and not p.kind)
        if uppers and upper is not None and unit is not special and upper.entry.size[0] < width + 0.1:
            kit.add(upper, at.at(0, 0, max(upper.entry.elevation, 1.4)))
        x += width
    if uppers:
        b.occupy_wall(frame, total, 1.35, 2.3)


def _bathroom(kit: Kit) -> None:
    b = kit.b
    basin = kit.pick("Sink", lambda p: p.kind in ("pedestal", "wall"))
    if basin is not None:
        width, depth, height = basin.entry.size
        frame = b.place(width + 0.2, depth)
        if frame is not None:
            kit.add(basin, frame.at(0, 0, basin.entry.elevation))
            b.occupy_wall(frame, width, 0, basin.entry.elevation + height)
            _mirror(b, frame)
    kit.stand("toilet")
    for role, p in {"bathtub": 0.7, "shower": 0.4, "bidet": 0.25, "washing_machine": 0.4, "stool": 0.25}.items():
        if b.chance(p):
            kit.stand(role, fits=lambda piece: piece.kind not in ("fittings", "door", "corner"))
    if b.chance(0.7):
        fu.cabinet(b, float(b.rng.uniform(0.4, 0.7)), 0.38, float(b.rng.uniform(0.6, 0.9)), "side")
    tops = ("side", "washing_machine", "stool")
    _tops(kit, {"SoapBar": 0.9, "SprayBottle": 0.9, "ToiletPaper": 0.7, "Towel": 0.3, "Vase": 0.1,
                "HousePlant": 0.2}, *tops)  # fmt: skip
    _tops(kit, {"SoapBar": 0.3, "SprayBottle": 0.25}, *tops)
    _clutter(kit, "clutter_bath", 3, *tops)
    for category, p in {"GarbageCan": 0.85, "HousePlant": 0.15}.items():
        if b.chance(p):
            kit.floor(category)
    _walls(kit, {"Towel": 0.95, "LightSwitch": 0.75, "ToiletPaper": 0.7, "Painting": 0.1})
    if b.chance(0.4):
        ob.hang(b, "Mirror")


def _mirror(b: Builder, frame: Frame) -> None:
    """A mirror over the basin."""
    if b.chance(0.8):
        ob.DRAWERS["Mirror"](b, b.new("Mirror"), frame)
        b.occupy_wall(frame, 0.7, 1.0, 2.0)


RECIPES: dict[str, Callable[[Kit], None]] = {
    "kitchen": _kitchen, "living_room": _living_room, "bedroom": _bedroom, "bathroom": _bathroom,
}  # fmt: skip
