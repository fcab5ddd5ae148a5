"""Meshes with texture coordinates for parts that carry a picture.

MuJoCo's own primitives cannot lay a 2-D picture on each face, so textured parts are drawn as
meshes and touched as primitives.
"""

from __future__ import annotations

import numpy as np

Mesh = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Vertices float64 [V, 3] (m), texture coordinates float64 [V, 2], faces int32 [F, 3]."""


def box(half: tuple[float, float, float], repeat: float | None) -> Mesh:
    """A box; each face shows the picture once, or one picture every ``repeat`` metres."""
    vertices: list[np.ndarray] = []
    coordinates: list[tuple[float, float]] = []
    faces: list[tuple[int, ...]] = []
    for normal in range(3):
        across, up = ((1, 2), (0, 2), (0, 1))[normal]
        for side in (-1.0, 1.0):
            # seen from outside, the picture's x axis must run to the viewer's right
            flip = side if normal == 0 else -side if normal == 1 else side
            start = len(vertices)
            for p, q in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                corner = np.zeros(3)
                corner[normal], corner[across], corner[up] = side, p, q
                vertices.append(corner * half)
                u, v = (p * flip + 1) / 2, (q + 1) / 2
                if normal == 2:
                    u = (p + 1) / 2
                if repeat is not None:
                    u, v = u * 2 * half[across] / repeat, v * 2 * half[up] / repeat
                coordinates.append((u, 1 - v))
            outward = np.cross(
                vertices[start + 1] - vertices[start], vertices[start + 2] - vertices[start]
            )
            order = (0, 1, 2, 0, 2, 3) if outward[normal] * side > 0 else (0, 2, 1, 0, 3, 2)
            faces += [tuple(start + i for i in order[:3]), tuple(start + i for i in order[3:])]
    return np.array(vertices), np.array(coordinates), np.array(faces, np.int32)


def cylinder(half: tuple[float, float, float], repeat: float | None, sides: int = 16) -> Mesh:
    """An upright cylinder with smooth wrap-around picture and plain caps."""
    radius, height = half[0], half[2]
    angle = 2 * np.pi * np.arange(sides + 1) / sides
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle)], 1)
    wraps = max(1, round(2 * np.pi * radius / repeat)) if repeat else 1
    vertices, coordinates, faces = [], [], []
    for z, v in ((-height, 1.0), (height, 0.0)):
        vertices += [(x, y, z) for x, y in ring]
        coordinates += [(i / sides * wraps, v) for i in range(sides + 1)]
    for i in range(sides):
        a, b, c, d = i, i + 1, i + sides + 1, i + sides + 2
        faces += [(a, b, c), (b, d, c)]
    for z, first in ((-height, True), (height, False)):
        start = len(vertices)
        vertices += [(0.0, 0.0, z), *((x, y, z) for x, y in ring)]
        coordinates += [
            (0.5, 0.5),
            *((0.5 + x / radius / 2, 0.5 + y / radius / 2) for x, y in ring),
        ]
        for i in range(sides):
            p, q = start + 1 + i, start + 2 + i
            faces.append((start, q, p) if first else (start, p, q))
    return np.array(vertices), np.array(coordinates), np.array(faces, np.int32)


def ellipsoid(half: tuple[float, float, float], repeat: float | None) -> Mesh:
    """An ellipsoid, wrapped once around."""
    del repeat
    around, down = 14, 8
    theta, phi = np.pi * np.arange(down + 1) / down, 2 * np.pi * np.arange(around + 1) / around
    t, p = np.meshgrid(theta, phi, indexing="ij")
    unit = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1)
    coordinates = np.stack([p / np.pi, t / np.pi], -1)
    faces = []
    for j in range(down):
        for i in range(around):
            a = j * (around + 1) + i
            b = a + around + 1
            if j > 0:
                faces.append((a, b, a + 1))
            if j < down - 1:
                faces.append((a + 1, b, b + 1))
    return (unit * half).reshape(-1, 3), coordinates.reshape(-1, 2), np.array(faces, np.int32)


MESHES = {"box": box, "cylinder": cylinder, "ellipsoid": ellipsoid}
