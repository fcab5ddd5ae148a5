"""Some models as an archive of their own, smaller than where they come from.

The same reader reads it. Only what is seen is kept: upright, positions to a 4000th of the longest
side, textures as large as the reader would make them.
"""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path

import cv2
import numpy as np

from sim_bridge.sweet_home.cache import load
from sim_bridge.sweet_home.catalogue import PROPERTIES, Entry
from sim_bridge.sweet_home.model import Mesh, Model

STEPS, UV_STEPS, NORMAL_STEPS = 4000, 1000, 64
"""Of the longest side, of a texture's side, and of a normal's length."""
JPEG_QUALITY = 88
WHEN = (1980, 1, 1, 0, 0, 0)
"""The time of all files: the same models make the same archive."""


def pack(models: Iterable[tuple[Entry, Mapping[str, str]]], path: Path) -> None:
    """Write an archive.

    Args:
        models: of each its entry, and names of objects or materials that stay apart.
        path: of the archive.
    """
    files: dict[str, bytes] = {}
    rows = []
    for number, (entry, apart) in enumerate(models, 1):
        model, name = load(entry, apart), entry.id.partition("#")[2]
        materials, textures = _materials(model)
        files[f"{name}/{name}.obj"] = _obj(model, name).encode("ascii")
        files[f"{name}/{name}.mtl"] = materials.encode("ascii")
        files |= textures
        rows += [f"{k}#{number}={v}" for k, v in _properties(entry, f"{name}/{name}.obj").items()]
    files[PROPERTIES] = "\n".join(rows).encode("latin-1")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_LZMA) as archive:
        for name in sorted(files):
            archive.writestr(zipfile.ZipInfo(name, WHEN), files[name], zipfile.ZIP_LZMA)


def _properties(entry: Entry, model: str) -> dict[str, str]:
    centimetres = dict(zip(("width", "depth", "height"), entry.size, strict=True))
    centimetres |= {"elevation": entry.elevation}
    if entry.drop_on_top is not None:
        centimetres["dropOnTopElevation"] = entry.drop_on_top
    lengths = {field: f"{100 * length:.6g}" for field, length in centimetres.items()}
    return {
        "id": entry.id, "name": entry.name, "category": entry.category, "creator": entry.creator,
        "license": "CC0-1.0", "model": model, "dropOnTopElevation": "-1", **lengths,
    }  # fmt: skip


def _obj(model: Model, name: str) -> str:
    unit, turn, sign = max(model.size) / STEPS, [0, 2, 1], (-1, 1, 1)  # y up, z to the viewer
    nothing = np.empty((0, 3))
    corners: dict[str, list[np.ndarray]] = {"v": [], "vt": [], "vn": []}
    for mesh in model.meshes:
        at, uv, normals = mesh.faces.ravel(), mesh.uv, mesh.normals
        corners["v"].append(mesh.vertices[at][:, turn] * sign / unit)
        corners["vt"].append(
            nothing[:, :2] if uv is None else (uv[at] * (1, -1) + (0, 1)) * UV_STEPS
        )
        corners["vn"].append(
            nothing if normals is None else normals[at][:, turn] * sign * NORMAL_STEPS
        )
    rows, numbers = {}, {}
    for key, parts in corners.items():
        rows[key], numbers[key] = _distinct(parts)
    lines = [f"mtllib {name}.mtl", *(f"v {x} {y} {z}" for x, y, z in rows["v"].tolist())]
    lines += [f"vt {x / UV_STEPS:g} {y / UV_STEPS:g}" for x, y in rows["vt"].tolist()]
    lines += [f"vn {x} {y} {z}" for x, y, z in rows["vn"].tolist()]
    for k, mesh in enumerate(model.meshes):
        columns = [found[k] if len(found[k]) else [""] * mesh.faces.size
                   for found in numbers.values()]  # fmt: skip
        words = ["/".join(map(str, corner)).rstrip("/") for corner in zip(*columns, strict=True)]
        lines += [f"o {mesh.name or name}", f"usemtl m{k}"]
        lines += [
            f"f {' '.join(words[i : i + 3])}" for i in range(0, len(words), 3)
            if len({*columns[0][i : i + 3]}) == 3  # thinner than a step
        ]  # fmt: skip
    return "\n".join(lines)


def _distinct(parts: list[np.ndarray]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Whole numbers of distinct rows in the order of their use, and of each part its rows from 1.

    A model's neighbours stay neighbours, which packs better than sorted rows.
    """
    rows = np.round(np.concatenate(parts)).astype(int)
    if not len(rows):
        return rows, [np.empty(0, int) for _ in parts]
    _, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    number = np.empty_like(order)
    number[order] = np.arange(1, len(order) + 1)
    ends = np.cumsum([len(part) for part in parts])[:-1]
    return rows[first[order]], np.split(number[inverse.ravel()], ends)


def _materials(model: Model) -> tuple[str, dict[str, bytes]]:
    """The MTL file, and the pictures that it names by path."""
    lines, pictures = [], {}
    for k, mesh in enumerate(model.meshes):
        red, green, blue, alpha = mesh.colour
        lines += [
            f"newmtl m{k}", f"Kd {red:.3g} {green:.3g} {blue:.3g}", f"d {alpha:.3g}",
            "Ks" + f" {mesh.specular:.3g}" * 3, f"Ns {128 * mesh.shininess:.3g}",
        ]  # fmt: skip
        if mesh.texture is not None:
            path, data = _picture(mesh)
            pictures[path] = data
            lines.append(f"map_Kd ../{path}")
    return "\n".join(lines), pictures


def _picture(mesh: Mesh) -> tuple[str, bytes]:
    assert mesh.texture is not None
    see_through = mesh.texture.shape[2] == 4
    order = cv2.COLOR_RGBA2BGRA if see_through else cv2.COLOR_RGB2BGR
    suffix, options = (".png", []) if see_through else (
        ".jpg", [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    )  # fmt: skip
    _, data = cv2.imencode(suffix, cv2.cvtColor(mesh.texture, order), options)
    name = hashlib.sha256(mesh.texture.tobytes()).hexdigest()[:12]
    return f"textures/{name}{suffix}", data.tobytes()
