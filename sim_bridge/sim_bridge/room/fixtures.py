"""Fixtures of kitchens and bathrooms: what stands where its pipes and cables are.

Like ``furniture``: each function finds its place, draws itself and offers its surfaces, in metres.
"""

from __future__ import annotations

from sim_bridge.room.furniture import DARK, METAL, drawer
from sim_bridge.room.parts import Builder, Frame, Surface, darker, hsv


def counter(b: Builder, width: float, depth: float = 0.6, kind: str = "counter") -> Frame | None:
    """Base cabinet with a worktop; sometimes a drawer stands open at mast height's lower end."""
    frame = b.place(width, depth)
    if frame is None:
        return None
    height = float(b.rng.uniform(0.84, 0.92))
    owner, (colour, _) = b.new("Counter"), b.tone()
    b.add(owner, "box", frame, (0, depth / 2 - 0.03, 0.05), (width / 2, depth / 2 - 0.03, 0.05),
          DARK)  # fmt: skip
    n = max(1, round(width / 0.5))
    for i in range(n):
        x = -width / 2 + (i + 0.5) * width / n
        b.add(owner, "box", frame, (x, depth / 2 - 0.01, height / 2 + 0.03),
              (width / n / 2, depth / 2 - 0.01, height / 2 - 0.07), colour,
              "panel_door")  # fmt: skip
        b.add(owner, "box", frame, (x, depth, height - 0.16), (0.06, 0.012, 0.01), METAL)
    top = hsv(float(b.rng.random()), 0.08, float(b.rng.uniform(0.35, 0.95)))
    b.add(owner, "box", frame, (0, depth / 2, height - 0.02), (width / 2, depth / 2, 0.02), top,
          "marble", 0.8)  # fmt: skip
    if b.chance(0.25):
        drawer(b, owner, frame.at(float(b.rng.uniform(-0.25, 0.25)) * width, depth), height - 0.2)
    b.surfaces.append(Surface(frame.at(0, 0, height), width, depth, kind))
    b.occupy_wall(frame, width, 0, height + 0.45)
    return frame


def upper_cabinet(b: Builder, frame: Frame, width: float) -> None:
    """Wall cupboard over a counter, above the mast."""
    owner, (colour, _) = b.new("Cabinet"), b.tone()
    n = max(1, round(width / 0.5))
    for i in range(n):
        x = -width / 2 + (i + 0.5) * width / n
        b.add(owner, "box", frame, (x, 0.16, 1.85), (width / n / 2, 0.16, 0.33), colour,
              "panel_door")  # fmt: skip
    b.occupy_wall(frame, width, 1.4, 2.3)


def fridge(b: Builder) -> None:
    """A fridge-freezer, a goal."""
    w, d = float(b.rng.uniform(0.6, 0.75)), float(b.rng.uniform(0.6, 0.68))
    frame = b.place(w, d)
    if frame is None:
        return
    owner = b.new("Fridge")
    colour = ((0.93, 0.93, 0.93), (0.78, 0.8, 0.83), (0.75, 0.86, 0.82), (0.85, 0.3, 0.25))[
        int(b.rng.integers(4))
    ]
    h = float(b.rng.uniform(1.55, 1.85))
    split = h * float(b.rng.uniform(0.58, 0.7))
    b.add(
        owner,
        "box",
        frame,
        (0, d / 2, split / 2),
        (w / 2, d / 2, split / 2 - 0.008),
        colour,
        "steel",
        0.8,
    )
    b.add(
        owner,
        "box",
        frame,
        (0, d / 2, (h + split) / 2),
        (w / 2, d / 2, (h - split) / 2),
        colour,
        "steel",
        0.8,
    )
    for z, half in ((split - 0.24, 0.15), (split + 0.2, 0.11)):
        b.add(
            owner, "box", frame, (-w / 2 + 0.07, d + 0.02, z), (0.014, 0.02, half), (0.3, 0.3, 0.32)
        )
    b.occupy_wall(frame, w, 0, h)


def stove(b: Builder) -> None:
    """A range; its burners are the goal StoveBurner and carry pans and pots."""
    frame = b.place(0.62, 0.62)
    if frame is None:
        return
    body, burners = b.new("Stove"), b.new("StoveBurner")
    b.add(body, "box", frame, (0, 0.3, 0.44), (0.3, 0.3, 0.44), (0.92, 0.92, 0.92), "oven")
    b.add(burners, "box", frame, (0, 0.31, 0.89), (0.3, 0.31, 0.012), DARK)
    for x in (-0.14, 0.14):
        for y in (0.17, 0.43):
            b.add(burners, "cylinder", frame, (x, y, 0.907), (0.095, 0.095, 0.006),
                  (0.75, 0.15, 0.08), emission=0.25)  # fmt: skip
            b.add(burners, "cylinder", frame, (x, y, 0.911), (0.05, 0.05, 0.006), DARK)
    b.surfaces.append(Surface(frame.at(0, 0, 0.918), 0.6, 0.6, "stove"))
    b.occupy_wall(frame, 0.62, 0, 1.3)


def toilet(b: Builder) -> None:
    """A toilet with its cistern to the wall."""
    frame = b.place(0.45, 0.72)
    if frame is None:
        return
    owner, white = b.new("Toilet"), (0.95, 0.95, 0.94)
    b.add(owner, "box", frame, (0, 0.1, 0.6), (0.2, 0.09, 0.2), white)
    b.add(owner, "box", frame, (0, 0.1, 0.815), (0.21, 0.1, 0.015), white)
    b.add(owner, "cylinder", frame, (0, 0.44, 0.17), (0.13, 0.13, 0.17), white)
    b.add(owner, "ellipsoid", frame, (0, 0.43, 0.36), (0.19, 0.26, 0.09), white)
    b.add(owner, "cylinder", frame, (0, 0.43, 0.44), (0.18, 0.18, 0.012), (0.86, 0.86, 0.84))
    b.occupy_wall(frame, 0.45, 0, 0.9)


def bathtub(b: Builder) -> None:
    """A filled bathtub along the wall."""
    w = float(b.rng.uniform(1.3, 1.6))
    frame = b.place(w, 0.72)
    if frame is None:
        return
    owner, white = b.new("Bathtub"), (0.93, 0.94, 0.95)
    for centre, half in (
        ((0, 0.04, 0.29), (w / 2, 0.04, 0.28)), ((0, 0.68, 0.29), (w / 2, 0.04, 0.28)),
        ((-w / 2 + 0.05, 0.36, 0.29), (0.05, 0.28, 0.28)),
        ((w / 2 - 0.05, 0.36, 0.29), (0.05, 0.28, 0.28)),
    ):  # fmt: skip
        b.add(owner, "box", frame, centre, half, white)
    b.add(owner, "box", frame, (0, 0.36, 0.36), (w / 2 - 0.1, 0.28, 0.02), (0.62, 0.78, 0.86))
    b.add(owner, "box", frame, (w / 2 - 0.05, 0.36, 0.68), (0.015, 0.015, 0.1), METAL)
    b.occupy_wall(frame, w, 0, 0.8)


def door(b: Builder, frame: Frame, width: float, height: float) -> None:
    """A door in its casing, of that size over all; its frame is on the wall."""
    owner, casing = b.new("Door"), 0.07
    colour = hsv(0.1, float(b.rng.uniform(0.0, 0.3)), float(b.rng.uniform(0.75, 0.97)))
    inner = width / 2 - casing
    for x in (-width / 2 + casing / 2, width / 2 - casing / 2):
        b.add(owner, "box", frame, (x, 0.015, height / 2), (casing / 2, 0.015, height / 2), colour)
    b.add(owner, "box", frame, (0, 0.015, height - casing / 2), (inner, 0.015, casing / 2), colour)
    b.add(owner, "box", frame, (0, 0.008, (height - casing) / 2),
          (inner, 0.008, (height - casing) / 2), darker(colour, 0.95), "panel_door")  # fmt: skip
    b.add(owner, "box", frame, (inner - 0.07, 0.02, 1.04), (0.02, 0.006, 0.1), METAL, solid=False)
    b.add(owner, "box", frame, (inner - 0.11, 0.05, 1.08), (0.06, 0.01, 0.01), METAL, solid=False)


def window_frame(b: Builder, frame: Frame, low: float, width: float, height: float) -> None:
    """What is around the two panes of a window that begins at ``low``, and its sill."""
    owner, bar, white = b.new("Window"), 0.04, (0.93, 0.93, 0.92)
    for x, half in ((0, 0.6 * bar), (-width / 2 + bar, bar), (width / 2 - bar, bar)):
        b.add(owner, "box", frame, (x, 0.02, low + height / 2), (half, 0.02, height / 2), white,
              solid=False)  # fmt: skip
    for z in (low + bar, low + height - bar):
        b.add(owner, "box", frame, (0, 0.018, z), (width / 2, 0.018, bar), white, solid=False)
    b.add(owner, "box", frame, (0, 0.06, low - 0.015), (width / 2 + 0.05, 0.06, 0.015), white,
          solid=False)  # fmt: skip
