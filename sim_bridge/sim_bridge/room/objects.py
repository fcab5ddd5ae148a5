"""The goal objects: one drawing function for each category that is not furniture.

A drawer gets (builder, object index, frame) with the frame's origin at the bottom centre of the
object (wall objects: on the wall at floor height) and y towards the viewer. Metres.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sim_bridge.room.furniture import DARK, METAL
from sim_bridge.room.parts import Builder, Frame, darker, hsv

WHITE = (0.95, 0.95, 0.95)
Drawer = Callable[[Builder, int, Frame], None]


def _pick(b: Builder, *colours: tuple[float, float, float]) -> tuple[float, float, float]:
    return colours[int(b.rng.integers(len(colours)))]


def alarm_clock(b: Builder, o: int, f: Frame) -> None:
    c = _pick(b, (0.75, 0.1, 0.1), (0.12, 0.12, 0.13), (0.1, 0.3, 0.6))
    b.add(o, "box", f, (0, 0, 0.07), (0.12, 0.05, 0.065), c)
    b.add(o, "box", f, (0, 0.052, 0.07), (0.105, 0.004, 0.052), WHITE, "clock_face", emission=0.5)
    b.add(o, "cylinder", f, (0, 0, 0.142), (0.03, 0.03, 0.008), METAL)


def apple(b: Builder, o: int, f: Frame) -> None:
    for x, y in ((0, 0), (0.075, 0.03), (0.02, -0.075)):
        c = (0.82, 0.08, 0.08) if b.chance(0.7) else (0.55, 0.8, 0.15)
        b.add(o, "ellipsoid", f, (x, y, 0.04), (0.042, 0.042, 0.04), c)
        b.add(o, "box", f, (x, y, 0.085), (0.004, 0.004, 0.012), (0.3, 0.2, 0.1))


def book(b: Builder, o: int, f: Frame) -> None:
    z = 0.0
    for _ in range(int(b.rng.integers(1, 4))):
        c = hsv(float(b.rng.random()), 0.75, float(b.rng.uniform(0.45, 0.85)))
        g = f.at(float(b.rng.uniform(-0.02, 0.02)), 0, z, float(b.rng.uniform(-0.2, 0.2)))
        b.add(o, "box", g, (0.004, 0, 0.022), (0.1, 0.14, 0.017), (0.95, 0.93, 0.85))
        b.add(o, "box", g, (0, 0, 0.003), (0.105, 0.145, 0.003), c)
        b.add(o, "box", g, (0, 0, 0.042), (0.105, 0.145, 0.004), c, "book_cover")
        z += 0.046


def bowl(b: Builder, o: int, f: Frame) -> None:
    c = hsv(float(b.rng.choice([0.58, 0.13, 0.4])) + float(b.rng.uniform(-0.03, 0.03)), 0.7, 0.9)
    b.add(o, "cylinder", f, (0, 0, 0.02), (0.06, 0.06, 0.02), c)
    b.add(o, "cylinder", f, (0, 0, 0.06), (0.12, 0.12, 0.02), c)
    b.add(o, "cylinder", f, (0, 0, 0.079), (0.105, 0.105, 0.003), darker(c, 0.45))


def bread(b: Builder, o: int, f: Frame) -> None:
    b.add(o, "box", f, (0, 0, 0.006), (0.17, 0.1, 0.006), (0.75, 0.55, 0.35), "wood", 0.4)
    b.add(o, "box", f, (0, 0, 0.055), (0.13, 0.06, 0.045), (1, 1, 1), "bread")
    b.add(o, "ellipsoid", f, (0, 0, 0.1), (0.13, 0.06, 0.03), (0.75, 0.45, 0.18))


def cd(b: Builder, o: int, f: Frame) -> None:
    for i in range(int(b.rng.integers(1, 4))):
        g = f.at(0, 0, i * 0.014, float(b.rng.uniform(-0.3, 0.3)))
        b.add(o, "box", g, (0, 0, 0.006), (0.085, 0.085, 0.006), WHITE, "disc")


def cell_phone(b: Builder, o: int, f: Frame) -> None:
    b.add(o, "box", f, (0, 0, 0.006), (0.05, 0.095, 0.006), DARK)
    b.add(o, "box", f, (0, 0, 0.0125), (0.044, 0.085, 0.001), (0.4, 0.9, 1.0), emission=0.8)


def coffee_machine(b: Builder, o: int, f: Frame) -> None:
    c = _pick(b, (0.12, 0.12, 0.13), (0.5, 0.08, 0.08), (0.32, 0.32, 0.34))
    b.add(o, "box", f, (0, 0, 0.02), (0.11, 0.15, 0.02), c)
    b.add(o, "box", f, (0, -0.1, 0.19), (0.11, 0.05, 0.17), c)
    b.add(o, "box", f, (0, 0, 0.33), (0.11, 0.15, 0.05), c, "steel", 0.3)
    b.add(o, "cylinder", f, (0, 0.05, 0.1), (0.07, 0.07, 0.06), (0.35, 0.2, 0.12))
    b.add(o, "cylinder", f, (0, 0.05, 0.17), (0.073, 0.073, 0.012), DARK)
    b.add(o, "box", f, (0, 0.152, 0.34), (0.025, 0.003, 0.014), (0.9, 0.3, 0.1), emission=0.6)


def desk_lamp(b: Builder, o: int, f: Frame) -> None:
    shade = hsv(float(b.rng.uniform(0.08, 0.16)), float(b.rng.uniform(0.1, 0.45)), 0.98)
    base, _ = b.tone()
    b.add(o, "cylinder", f, (0, 0, 0.012), (0.085, 0.085, 0.012), base)
    b.add(o, "cylinder", f, (0, 0, 0.16), (0.016, 0.016, 0.15), base)
    b.add(o, "cylinder", f, (0, 0, 0.36), (0.125, 0.125, 0.085), shade, emission=0.65)
    b.add(o, "cylinder", f, (0, 0, 0.455), (0.085, 0.085, 0.012), shade, emission=0.65)


def floor_lamp(b: Builder, o: int, f: Frame) -> None:
    shade = hsv(float(b.rng.uniform(0.08, 0.16)), float(b.rng.uniform(0.1, 0.4)), 0.98)
    h = float(b.rng.uniform(1.25, 1.5))
    b.add(o, "cylinder", f, (0, 0, 0.015), (0.14, 0.14, 0.015), DARK)
    b.add(o, "cylinder", f, (0, 0, h / 2), (0.016, 0.016, h / 2), (0.5, 0.45, 0.3))
    b.add(o, "cylinder", f, (0, 0, h), (0.17, 0.17, 0.12), shade, emission=0.65)
    b.add(o, "cylinder", f, (0, 0, h + 0.13), (0.12, 0.12, 0.015), shade, emission=0.65)


def garbage_can(b: Builder, o: int, f: Frame) -> None:
    c = _pick(b, (0.42, 0.45, 0.48), (0.14, 0.14, 0.15), (0.15, 0.32, 0.55), (0.2, 0.45, 0.25))
    h = float(b.rng.uniform(0.2, 0.3))
    b.add(o, "cylinder", f, (0, 0, h), (0.15, 0.15, h), c, "steel", 0.5)
    b.add(o, "cylinder", f, (0, 0, 2 * h + 0.012), (0.165, 0.165, 0.014), darker(c, 0.6))
    b.add(o, "cylinder", f, (0, 0, 2 * h + 0.028), (0.12, 0.12, 0.003), (0.05, 0.05, 0.05))


def house_plant(b: Builder, o: int, f: Frame) -> None:
    big = f.z < 0.1
    k = 1.0 if big else 0.55
    pot = hsv(float(b.rng.uniform(0.02, 0.08)), 0.6, float(b.rng.uniform(0.55, 0.85)))
    b.add(o, "cylinder", f, (0, 0, 0.14 * k), (0.13 * k, 0.13 * k, 0.14 * k), pot)
    b.add(o, "cylinder", f, (0, 0, 0.285 * k), (0.14 * k, 0.14 * k, 0.02 * k), darker(pot, 0.85))
    b.add(o, "cylinder", f, (0, 0, 0.42 * k), (0.018, 0.018, 0.16 * k), (0.4, 0.3, 0.2))
    for _ in range(6):
        x, y = (float(v) * k for v in b.rng.uniform(-0.12, 0.12, 2))
        z = float(b.rng.uniform(0.45, 0.85)) * k
        half = tuple(float(v) * k for v in b.rng.uniform((0.09, 0.09, 0.1), (0.17, 0.17, 0.2)))
        green = hsv(float(b.rng.uniform(0.27, 0.36)), 0.5, float(b.rng.uniform(0.6, 1.0)))
        b.add(o, "ellipsoid", f, (x, y, z), half, green, "leaf", 0.3)  # type: ignore[arg-type]


def kettle(b: Builder, o: int, f: Frame) -> None:
    c = _pick(b, (0.75, 0.77, 0.8), (0.85, 0.35, 0.15), (0.2, 0.5, 0.55))
    b.add(o, "cylinder", f, (0, 0, 0.015), (0.085, 0.085, 0.015), DARK)
    b.add(o, "cylinder", f, (0, 0, 0.11), (0.08, 0.08, 0.08), c, "steel", 0.3)
    b.add(o, "ellipsoid", f, (0, 0, 0.19), (0.08, 0.08, 0.05), c)
    b.add(o, "ellipsoid", f, (0, 0, 0.245), (0.02, 0.02, 0.02), DARK)
    b.add(o, "box", f, (0.1, 0, 0.16), (0.04, 0.012, 0.015), c)
    b.add(o, "box", f, (-0.115, 0, 0.13), (0.012, 0.014, 0.07), DARK)
    b.add(o, "box", f, (-0.09, 0, 0.2), (0.035, 0.014, 0.012), DARK)


def laptop(b: Builder, o: int, f: Frame) -> None:
    c = _pick(b, (0.78, 0.78, 0.8), (0.17, 0.17, 0.18))
    b.add(o, "box", f, (0, 0.01, 0.011), (0.18, 0.125, 0.011), c)
    b.add(o, "box", f, (0, 0.01, 0.0225), (0.165, 0.11, 0.0015), WHITE, "keyboard")
    b.add(o, "box", f, (0, -0.125, 0.135), (0.18, 0.009, 0.12), c)
    b.add(o, "box", f, (0, -0.114, 0.138), (0.166, 0.003, 0.106), WHITE, "screen", emission=0.5)


def microwave(b: Builder, o: int, f: Frame) -> None:
    c = _pick(b, (0.88, 0.88, 0.88), (0.25, 0.25, 0.27), (0.62, 0.62, 0.64))
    b.add(o, "box", f, (0, 0, 0.14), (0.24, 0.17, 0.14), c)
    b.add(o, "box", f, (0, 0.172, 0.14), (0.235, 0.004, 0.13), WHITE, "microwave")


def mug(b: Builder, o: int, f: Frame) -> None:
    c = hsv(float(b.rng.choice([0.0, 0.6, 0.15, 0.85])), 0.8, 0.85)
    b.add(o, "cylinder", f, (0, 0, 0.055), (0.048, 0.048, 0.055), c)
    b.add(o, "cylinder", f, (0, 0, 0.1105), (0.04, 0.04, 0.001), (0.25, 0.14, 0.08))
    b.add(o, "box", f, (0.06, 0, 0.055), (0.02, 0.008, 0.032), c)


def pan(b: Builder, o: int, f: Frame) -> None:
    b.add(o, "cylinder", f, (0, 0, 0.022), (0.125, 0.125, 0.022), DARK)
    b.add(o, "cylinder", f, (0, 0, 0.0445), (0.11, 0.11, 0.001), (0.32, 0.3, 0.3))
    b.add(o, "box", f, (0, 0.2, 0.035), (0.016, 0.09, 0.01), (0.45, 0.25, 0.12))


def pillow(b: Builder, o: int, f: Frame) -> None:
    c = hsv(float(b.rng.random()), float(b.rng.uniform(0.1, 0.8)), float(b.rng.uniform(0.8, 1.0)))
    b.add(o, "ellipsoid", f, (0, 0, 0.08), (0.26, 0.18, 0.09), c, "fabric", 0.4)
    b.add(o, "box", f, (0, 0, 0.08), (0.2, 0.13, 0.045), c, "fabric", 0.4)


def plate(b: Builder, o: int, f: Frame) -> None:
    rim = hsv(float(b.rng.choice([0.6, 0.0, 0.35])), 0.7, 0.7)
    b.add(o, "cylinder", f, (0, 0, 0.008), (0.135, 0.135, 0.008), rim)
    b.add(o, "cylinder", f, (0, 0, 0.0165), (0.12, 0.12, 0.001), (0.98, 0.98, 0.98))
    b.add(o, "cylinder", f, (0, 0, 0.018), (0.075, 0.075, 0.001), (0.86, 0.87, 0.9))


def pot(b: Builder, o: int, f: Frame) -> None:
    c = _pick(b, (0.8, 0.82, 0.85), (0.8, 0.25, 0.12), (0.95, 0.8, 0.3))
    b.add(o, "cylinder", f, (0, 0, 0.07), (0.11, 0.11, 0.07), c, "steel", 0.3)
    b.add(o, "cylinder", f, (0, 0, 0.146), (0.113, 0.113, 0.008), darker(c, 0.75))
    b.add(o, "ellipsoid", f, (0, 0, 0.17), (0.02, 0.02, 0.018), DARK)
    for x in (-0.13, 0.13):
        b.add(o, "box", f, (x, 0, 0.11), (0.025, 0.03, 0.009), DARK)


def remote_control(b: Builder, o: int, f: Frame) -> None:
    b.add(o, "box", f, (0, 0, 0.011), (0.032, 0.11, 0.011), DARK)
    b.add(o, "box", f, (0, 0.08, 0.023), (0.012, 0.012, 0.003), (0.95, 0.1, 0.1))
    for i in range(4):
        b.add(o, "box", f, (0, 0.045 - 0.035 * i, 0.023), (0.022, 0.009, 0.003), (0.85, 0.85, 0.85))


def sink(b: Builder, o: int, f: Frame) -> None:
    b.add(o, "box", f, (0, 0.02, 0.008), (0.26, 0.2, 0.009), METAL, "steel", 0.4)
    b.add(o, "box", f, (0, 0.03, 0.017), (0.21, 0.145, 0.002), (0.24, 0.26, 0.29))
    b.add(o, "cylinder", f, (0, 0.03, 0.02), (0.025, 0.025, 0.002), METAL)
    b.add(o, "cylinder", f, (0, -0.16, 0.13), (0.02, 0.02, 0.12), (0.85, 0.87, 0.9))
    b.add(o, "box", f, (0, -0.08, 0.25), (0.018, 0.1, 0.018), (0.85, 0.87, 0.9))
    for x in (-0.09, 0.09):
        b.add(o, "cylinder", f, (x, -0.16, 0.05), (0.022, 0.022, 0.04), (0.85, 0.87, 0.9))


def soap_bar(b: Builder, o: int, f: Frame) -> None:
    c = hsv(float(b.rng.choice([0.33, 0.92, 0.13])), 0.55, 0.95)
    b.add(o, "box", f, (0, 0, 0.007), (0.085, 0.06, 0.007), (0.35, 0.37, 0.42))
    b.add(o, "ellipsoid", f, (0, 0, 0.03), (0.065, 0.043, 0.024), c)


def spatula(b: Builder, o: int, f: Frame) -> None:
    c = _pick(b, (0.9, 0.2, 0.1), (0.15, 0.55, 0.25), (0.95, 0.6, 0.1))
    b.add(o, "box", f, (0, 0.11, 0.012), (0.05, 0.07, 0.008), c)
    b.add(o, "box", f, (0, -0.04, 0.012), (0.01, 0.09, 0.008), (0.75, 0.6, 0.4))
    b.add(o, "box", f, (0, -0.15, 0.014), (0.018, 0.045, 0.01), c)


def spray_bottle(b: Builder, o: int, f: Frame) -> None:
    c = hsv(float(b.rng.choice([0.55, 0.33, 0.8])) + float(b.rng.uniform(-0.03, 0.03)), 0.75, 0.9)
    b.add(o, "cylinder", f, (0, 0, 0.09), (0.055, 0.055, 0.09), c)
    b.add(o, "cylinder", f, (0, 0, 0.2), (0.022, 0.022, 0.03), WHITE)
    b.add(o, "box", f, (0, 0.025, 0.245), (0.018, 0.055, 0.018), (0.95, 0.3, 0.1))
    b.add(o, "box", f, (0, 0.045, 0.21), (0.01, 0.008, 0.025), (0.95, 0.3, 0.1))


def television(b: Builder, o: int, f: Frame) -> None:
    w = float(b.rng.uniform(0.4, 0.55))
    b.add(o, "box", f, (0, 0, 0.01), (0.17, 0.1, 0.01), DARK)
    b.add(o, "box", f, (0, 0, 0.06), (0.03, 0.02, 0.05), DARK)
    b.add(o, "box", f, (0, 0, 0.1 + 0.57 * w), (w, 0.025, 0.58 * w), (0.08, 0.08, 0.08))
    b.add(o, "box", f, (0, 0.027, 0.1 + 0.57 * w), (w - 0.02, 0.003, 0.55 * w), WHITE, "television",
          emission=0.2)  # fmt: skip


def toaster(b: Builder, o: int, f: Frame) -> None:
    c = _pick(b, (0.82, 0.82, 0.84), (0.8, 0.15, 0.12), (0.9, 0.85, 0.7))
    b.add(o, "box", f, (0, 0, 0.1), (0.15, 0.095, 0.09), c, "steel", 0.3)
    for y in (-0.035, 0.035):
        b.add(o, "box", f, (0, y, 0.191), (0.11, 0.015, 0.003), (0.05, 0.05, 0.05))
        b.add(o, "box", f, (0, y, 0.205), (0.08, 0.01, 0.015), (0.85, 0.6, 0.3))
    b.add(o, "box", f, (0.16, 0, 0.13), (0.014, 0.03, 0.014), DARK)


def toilet_paper(b: Builder, o: int, f: Frame) -> None:
    for i in range(int(b.rng.integers(1, 4))):
        g = f.at((i % 2) * 0.155, 0, 0.0 if i < 2 else 0.12)
        b.add(o, "cylinder", g, (0, 0, 0.06), (0.072, 0.072, 0.06), (0.98, 0.98, 0.96))
        b.add(o, "cylinder", g, (0, 0, 0.121), (0.024, 0.024, 0.002), (0.45, 0.33, 0.22))


def vase(b: Builder, o: int, f: Frame) -> None:
    c = hsv(float(b.rng.choice([0.55, 0.0, 0.78])) + float(b.rng.uniform(-0.03, 0.03)), 0.65, 0.85)
    b.add(o, "ellipsoid", f, (0, 0, 0.11), (0.085, 0.085, 0.11), c)
    b.add(o, "cylinder", f, (0, 0, 0.22), (0.035, 0.035, 0.06), c)
    b.add(o, "cylinder", f, (0, 0, 0.285), (0.055, 0.055, 0.01), darker(c, 0.8))
    for _ in range(4):
        x, y = (float(v) for v in b.rng.uniform(-0.06, 0.06, 2))
        bloom = hsv(float(b.rng.choice([0.95, 0.13, 0.0])), 0.7, 1.0)
        b.add(o, "box", f, (x * 0.6, y * 0.6, 0.34), (0.005, 0.005, 0.06), (0.25, 0.5, 0.2))
        b.add(o, "ellipsoid", f, (x, y, 0.41), (0.035, 0.035, 0.03), bloom)


# Wall objects: the frame lies on the wall at floor height.


def blinds(b: Builder, o: int, f: Frame) -> None:
    w, drop = float(b.rng.uniform(0.4, 0.6)), float(b.rng.uniform(0.35, 0.5))
    view = b.new("Window")
    b.add(
        view,
        "box",
        f,
        (0, 0.01, 1.55),
        (w, 0.01, 0.52),
        WHITE,
        "window_view",
        solid=False,
        emission=0.4,
    )
    tint = hsv(float(b.rng.uniform(0.08, 0.14)), float(b.rng.uniform(0.0, 0.4)), 1.0)
    b.add(o, "box", f, (0, 0.035, 2.07 - drop), (w + 0.03, 0.012, drop), tint, "slats", 0.5)
    b.add(o, "box", f, (0, 0.035, 2.08), (w + 0.04, 0.03, 0.025), darker(tint, 0.75))


def light_switch(b: Builder, o: int, f: Frame) -> None:
    b.add(o, "box", f, (0, 0.008, 1.15), (0.065, 0.008, 0.085), (0.97, 0.97, 0.94))
    b.add(o, "box", f, (0, 0.017, 1.15), (0.04, 0.004, 0.055), (0.25, 0.26, 0.3))
    b.add(o, "box", f, (0, 0.023, 1.175), (0.022, 0.006, 0.02), (0.97, 0.97, 0.94))


def mirror(b: Builder, o: int, f: Frame) -> None:
    w = float(b.rng.uniform(0.25, 0.4))
    b.add(o, "box", f, (0, 0.012, 1.5), (w, 0.012, 0.36), WHITE, "mirror_glass", emission=0.15)


def painting(b: Builder, o: int, f: Frame) -> None:
    w, h = float(b.rng.uniform(0.28, 0.5)), float(b.rng.uniform(0.22, 0.36))
    name = f"picture{int(b.rng.integers(3))}"
    b.add(o, "box", f, (0, 0.015, float(b.rng.uniform(1.45, 1.65))), (w, 0.015, h), WHITE, name)


def towel(b: Builder, o: int, f: Frame) -> None:
    c = hsv(float(b.rng.random()), float(b.rng.uniform(0.4, 0.8)), float(b.rng.uniform(0.6, 0.95)))
    b.add(o, "box", f, (0, 0.05, 1.2), (0.3, 0.01, 0.012), METAL)
    b.add(o, "box", f, (0, 0.05, 1.0), (0.2, 0.025, 0.22), c, "stripes", 0.4)


DRAWERS: dict[str, Drawer] = {
    "AlarmClock": alarm_clock, "Apple": apple, "Blinds": blinds, "Book": book, "Bowl": bowl,
    "Bread": bread, "CD": cd, "CellPhone": cell_phone, "CoffeeMachine": coffee_machine,
    "DeskLamp": desk_lamp, "FloorLamp": floor_lamp, "GarbageCan": garbage_can,
    "HousePlant": house_plant, "Kettle": kettle, "Laptop": laptop, "LightSwitch": light_switch,
    "Microwave": microwave, "Mirror": mirror, "Mug": mug, "Painting": painting, "Pan": pan,
    "Pillow": pillow, "Plate": plate, "Pot": pot, "RemoteControl": remote_control, "Sink": sink,
    "SoapBar": soap_bar, "Spatula": spatula, "SprayBottle": spray_bottle,
    "Television": television, "Toaster": toaster, "ToiletPaper": toilet_paper, "Towel": towel,
    "Vase": vase,
}  # fmt: skip
"""Categories that are placed on surfaces, the floor or a wall. ArmChair, Chair, Fridge and
StoveBurner are furniture and draw themselves."""

WALL_SPANS = {
    "Blinds": (1.3, 1.0, 2.1), "LightSwitch": (0.15, 1.0, 1.3), "Mirror": (0.7, 1.1, 1.9),
    "Painting": (1.0, 1.1, 2.0), "Towel": (0.62, 0.7, 1.25),
}  # fmt: skip
"""Wall objects: width, lowest and highest point, metres."""

RADIUS = {"Microwave": 0.27, "Sink": 0.3, "Television": 0.42, "Pillow": 0.27, "Laptop": 0.2}
"""Space an object needs on a surface, metres; 0.13 when absent."""

TALLEST_M = 0.46
"""Of the objects that stand on surfaces."""

BACK_OF_SURFACE = frozenset({"Microwave", "Toaster", "CoffeeMachine", "Television", "Kettle"})
FACING = frozenset({"Television", "Sink", "Microwave"})


def put(b: Builder, category: str, kinds: tuple[str, ...]) -> bool:
    """Put one object of a category on a surface of one of the kinds; False when none has room."""
    frame = spot(b, category, kinds, RADIUS.get(category, 0.13))
    if frame is None:
        return False
    turn = 0.0 if category in FACING else float(b.rng.uniform(-0.5, 0.5))
    DRAWERS[category](b, b.new(category), frame.at(0, 0, 0, turn))
    return True


def spot(b: Builder, category: str, kinds: tuple[str, ...], radius: float) -> Frame | None:
    """A free place for an object of a radius (m) on a surface of one of the kinds, now taken."""
    surfaces = [s for s in b.surfaces if s.kind in kinds and s.clear > TALLEST_M]
    for _ in range(40 if surfaces else 0):
        s = surfaces[int(b.rng.integers(len(surfaces)))]
        side = radius * 0.9
        front = min(side, 0.17, s.depth / 2 - 0.005)
        if s.width < 2 * side:
            continue
        x = float(b.rng.uniform(-s.width / 2 + side, s.width / 2 - side))
        y = float(b.rng.uniform(front, s.depth - front))
        if category in BACK_OF_SURFACE:
            y = min(y, max(front, 0.42 * s.depth))
        if any(o is s and np.hypot(ox - x, oy - y) < r + radius for o, ox, oy, r in b.on_surface):
            continue
        b.on_surface.append((s, x, y, radius))
        return s.frame.at(x, y)
    return None


def stand(b: Builder, category: str, size: float = 0.36) -> bool:
    """Stand one object on the floor; False when there is no place."""
    frame = b.place(size, size, wall=b.chance(0.85))
    if frame is None:
        return False
    DRAWERS[category](b, b.new(category), frame.at(0, size / 2))
    return True


def hang(b: Builder, category: str) -> bool:
    """Hang one object on a free stretch of wall; False when there is none."""
    width, low, high = WALL_SPANS[category]
    frame = b.wall_spot(width, low, high)
    if frame is None:
        return False
    DRAWERS[category](b, b.new(category), frame)
    return True
