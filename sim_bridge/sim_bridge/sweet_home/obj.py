"""Wavefront OBJ and MTL as arrays: one group of triangles for each material, or named object.

Own code, as what is on PyPI does not fit: tinyobjloader has no release but candidates, PyWavefront
rests since 2020 and drops indices, trimesh merges and splits parts on its way through a dozen
optional packages. Knows nothing of sizes, pictures or MuJoCo.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Material:
    """How a surface looks.

    Attributes:
        colour: diffuse red, green, blue, 0..1 (``Kd``).
        alpha: 1 opaque, 0 not there (``d``, or 1 - ``Tr``).
        picture: file name of the texture as written, or None (``map_Kd``).
        specular: 0..1, mean of ``Ks``.
        shininess: 0..1, ``Ns`` / 128.
    """

    colour: tuple[float, float, float] = (0.7, 0.7, 0.7)
    alpha: float = 1.0
    picture: str | None = None
    specular: float = 0.0
    shininess: float = 0.0


BUILT_IN = {"glasstransparent": Material((0.469,) * 3, 0.25, None, 0.608, 1.0)}
"""Materials that files use without saying how they look, as the loaders that they were made for
know them. Source: the default materials of Java 3D's ``ObjectFile``."""


@dataclass(frozen=True)
class Obj:
    """The contents of an OBJ file.

    Attributes:
        vertices: float64 [N, 3].
        coordinates: float64 [M, 2], of the picture, v upwards.
        normals: float64 [K, 3].
        groups: by name of material ("" before the first) and of the object that stays apart, or
            "", int32 [F, 3, 3]: for each corner of each triangle the rows of vertex, coordinates
            and normal, -1 where it has none.
        libraries: file names of MTL files as written.
    """

    vertices: np.ndarray
    coordinates: np.ndarray
    normals: np.ndarray
    groups: dict[tuple[str, str], np.ndarray]
    libraries: tuple[str, ...]


def read_obj(text: str, apart: Collection[str] = ()) -> Obj:
    """Read an OBJ file; polygons become fans of triangles.

    Args:
        text: of the file.
        apart: names of objects, groups or materials whose triangles are kept by themselves.

    Raises:
        ValueError: a number is none, or a face names what is not there; one sentence.
    """
    rows: dict[str, list[list[str]]] = {"v": [], "vt": [], "vn": []}
    groups: dict[tuple[str, str], list[tuple[Corner, ...]]] = {}
    libraries: list[str] = []
    material = thing = ""
    for line in re.sub(r"\\\r?\n", " ", text).splitlines():
        key, *words = line.split() or [""]
        if key in rows:
            rows[key].append(words)
        elif key == "f":
            counts = len(rows["v"]), len(rows["vt"]), len(rows["vn"])
            corners = [_corner(word, counts) for word in words]
            name = next((name for name in (thing, material) if name in apart), "")
            groups.setdefault((material, name), []).extend(
                (corners[0], *corners[i : i + 2]) for i in range(1, len(corners) - 1)
            )
        elif key in ("o", "g"):
            thing = line.partition(key)[2].strip()
        elif key == "usemtl":
            material = line.partition(key)[2].strip()
        elif key == "mtllib":
            libraries.append(line.partition(key)[2].strip())
    return Obj(
        _numbers(rows["v"], 3), _numbers(rows["vt"], 2), _numbers(rows["vn"], 3),
        {name: np.array(group, np.int32) for name, group in groups.items() if group},
        tuple(libraries),
    )  # fmt: skip


Corner = tuple[int, int, int]


def _corner(word: str, counts: Corner) -> Corner:
    """Rows of "7/2/-1": counted from 1, or back from the last that was read."""
    found = [-1, -1, -1]
    for i, index in enumerate(word.split("/")[:3]):
        if index:
            number = int(index)
            found[i] = number - 1 if number > 0 else counts[i] + number
            if not 0 <= found[i] < counts[i]:
                raise ValueError(f"found corner {word!r} of a face, but only {counts[i]} rows")
    if found[0] < 0:
        raise ValueError(f"found corner {word!r} of a face, expected the number of a vertex")
    return found[0], found[1], found[2]


def _numbers(rows: Sequence[Sequence[str]], columns: int) -> np.ndarray:
    """float64 [N, columns]; a row that is too short ends with zeros."""
    padded = [(*row, *("0",) * columns)[:columns] for row in rows]
    numbers = np.array(padded, float).reshape(-1, columns)
    if not np.isfinite(numbers).all():
        raise ValueError("found a vertex, coordinate or normal that is not a number")
    return numbers


def read_materials(text: str) -> dict[str, Material]:
    """Read an MTL file.

    Raises:
        ValueError: a number is none.
    """
    blocks: dict[str, dict[str, str]] = {}
    block: dict[str, str] = {}
    for line in text.splitlines():
        key, _, value = line.strip().replace("\t", " ").partition(" ")
        if key == "newmtl":
            block = blocks.setdefault(value.strip(), {})
        else:
            block[key] = value.strip()
    return {name: _material(block) for name, block in blocks.items()}


def _material(block: dict[str, str]) -> Material:
    alpha = 1 - float(block["Tr"]) if "Tr" in block else 1.0
    if "d" in block:
        alpha = float(block["d"].split()[-1])
    red, green, blue = _clipped(block.get("Kd", ""), (0.7, 0.7, 0.7))
    return Material(
        (red, green, blue), min(max(alpha, 0.0), 1.0), block.get("map_Kd") or None,
        float(np.mean(_clipped(block.get("Ks", ""), (0.0, 0.0, 0.0)))),
        min(max(float(block.get("Ns", 0)) / 128, 0.0), 1.0),
    )  # fmt: skip


def _clipped(text: str, default: tuple[float, ...]) -> tuple[float, ...]:
    numbers = [min(max(float(word), 0.0), 1.0) for word in text.split()[:3]]
    return tuple(numbers) if len(numbers) == 3 else default
