"""A model of the furniture as meshes: read from its archive, set upright, stretched to its size.

Frame: origin at the middle of the bottom of the bounding box, x to the thing's own right, y to its
front, z up; metres. Whoever looks at its front stands at positive y.
"""

from __future__ import annotations

import posixpath
import zipfile
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from sim_bridge.sweet_home.bands import Box, boxes
from sim_bridge.sweet_home.catalogue import Entry, SweetHomeError, package_of
from sim_bridge.sweet_home.obj import BUILT_IN, Material, Obj, read_materials, read_obj

LARGEST = 70_000
"""Triangles of the largest model that is read. Some 20 trees, cars and the like have 80,000 to
200,000; thinning spoils just those, with leaves and seams, so they are left out."""
TEXTURE_SIDE = 256
"""Pixels; larger pictures are averaged down to it, each side by itself."""
UNSEEN_ALPHA = 0.02
SMALLEST_AREA_M2 = 1e-12


@dataclass(frozen=True)
class Mesh:
    """All triangles of one material, or those of it that belong to an object of a name.

    Attributes:
        name: of the object or material that was to stay apart, else "".
        vertices: float32 [N, 3], metres in the model's frame.
        faces: int32 [F, 3], counter-clockwise seen from outside.
        uv: float32 [N, 2], (0, 0) the top left of the texture, which repeats; None without one.
        normals: float32 [N, 3] of length 1, or None.
        colour: red, green, blue, alpha, 0..1; white under a texture.
        texture: uint8 [H, W, 3] or, with its own alpha, [H, W, 4]; or None.
        specular, shininess: 0..1.
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray | None
    normals: np.ndarray | None
    colour: tuple[float, float, float, float]
    texture: np.ndarray | None
    specular: float
    shininess: float

    @property
    def transparent(self) -> bool:
        """Whether something shows through."""
        return self.colour[3] < 1 or (self.texture is not None and self.texture.shape[2] == 4)


@dataclass(frozen=True)
class Model:
    """A piece of furniture.

    Attributes:
        id: of its ``Entry``.
        size: width, depth, height, metres.
        meshes: what is seen, the transparent ones last.
        boxes: what is touched where it stands at the elevation of its entry.
    """

    id: str
    size: tuple[float, float, float]
    meshes: tuple[Mesh, ...]
    boxes: tuple[Box, ...]

    @property
    def transparent(self) -> bool:
        """Whether something shows through a part of it."""
        return any(mesh.transparent for mesh in self.meshes)

    @property
    def triangles(self) -> np.ndarray:
        """float64 [T, 3, 3]: the corners of all triangles, metres."""
        return triangles_of(self.meshes)


def triangles_of(meshes: tuple[Mesh, ...]) -> np.ndarray:
    """float64 [T, 3, 3]: the corners of all triangles of some meshes, metres."""
    return np.concatenate([mesh.vertices[mesh.faces].astype(float) for mesh in meshes])


def build(entry: Entry, apart: Collection[str] = ()) -> Model:
    """Read a model from its archive.

    Args:
        entry: of the model.
        apart: names of objects or materials in its file that become meshes of their own.

    Raises:
        SweetHomeError: the archive or the model is damaged, has nothing to see, or has more than
            ``LARGEST`` triangles.
    """
    try:
        with zipfile.ZipFile(entry.archive) as archive:
            meshes = _meshes(_Files(archive, entry.model), entry, apart)
    except (OSError, KeyError, ValueError, zipfile.BadZipFile, zlib.error) as error:
        if isinstance(error, SweetHomeError):
            raise
        raise SweetHomeError(
            f"found {entry.id} damaged in {entry.archive} ({error}); install "
            f"{package_of(entry.archive)} again, or leave this model out"
        ) from error
    return Model(entry.id, entry.size, meshes, tuple(boxes(triangles_of(meshes), entry.elevation)))


class _Files:
    """Files beside a model; the case of letters does not count, as where they were made."""

    def __init__(self, archive: zipfile.ZipFile, model: str) -> None:
        self._archive = archive
        self._names = {name.lower(): name for name in archive.namelist()}
        self._folder = posixpath.dirname(model)
        self.model = self.text(posixpath.basename(model)) or ""
        if not self.model:
            raise ValueError(f"there is no {model}")

    def bytes(self, name: str) -> bytes | None:
        """The contents of a file, None where it is not there."""
        path = posixpath.normpath(posixpath.join(self._folder, name.replace("\\", "/")))
        found = self._names.get(path.lower())
        return None if found is None else self._archive.read(found)

    def text(self, name: str) -> str | None:
        """The same as text."""
        found = self.bytes(name)
        return None if found is None else found.decode("latin-1")

    def materials(self, libraries: tuple[str, ...]) -> dict[str, Material]:
        """All materials of a model; a line may name one file with spaces, or several without."""
        found = dict(BUILT_IN)
        for line in libraries:
            whole = self.text(line)
            texts = [whole] if whole is not None else [self.text(name) for name in line.split()]
            for text in texts:
                found |= read_materials(text or "")
        return found


def _meshes(files: _Files, entry: Entry, apart: Collection[str]) -> tuple[Mesh, ...]:
    obj = read_obj(files.model, apart)
    count = sum(map(len, obj.groups.values()))
    if not 0 < count <= LARGEST:
        raise SweetHomeError(
            f"found {count:,} triangles in {entry.id}, expected 1 to {LARGEST:,}; leave it out"
        )
    obj = _placed(obj, entry)
    materials = files.materials(obj.libraries)
    found = [
        mesh
        for (material, name), corners in obj.groups.items()
        for mesh in _mesh(obj, corners, materials.get(material, Material()), files, name)
    ]
    if not found:
        raise SweetHomeError(f"found nothing to see in {entry.id}; leave it out")
    return tuple(sorted(found, key=lambda mesh: mesh.transparent))


def _placed(obj: Obj, entry: Entry) -> Obj:
    """The same in the model's frame and size."""
    turn = np.array(entry.rotation).T[:, [0, 2, 1]] * (-1, 1, 1)
    vertices, normals = obj.vertices @ turn, obj.normals @ turn
    used = vertices[np.unique(np.concatenate([g[..., 0].ravel() for g in obj.groups.values()]))]
    low, high = used.min(0), used.max(0)
    extent = high - low
    flat = extent < 1e-9
    stretch = np.where(flat, 1.0, np.array(entry.size) / np.where(flat, 1.0, extent))
    origin = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]])
    return Obj((vertices - origin) * stretch, obj.coordinates, normals / stretch, obj.groups,
               obj.libraries)  # fmt: skip


def _mesh(
    obj: Obj, corners: np.ndarray, material: Material, files: _Files, name: str
) -> Iterator[Mesh]:
    """The triangles of one group; nothing where none can be seen."""
    a, b, c = np.moveaxis(obj.vertices[corners[..., 0]], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    corners = corners[area > SMALLEST_AREA_M2]
    if not len(corners) or material.alpha < UNSEEN_ALPHA:
        return
    rows, faces = _distinct(corners)
    mapped, shaded = bool((rows[:, 1] >= 0).all()), bool((rows[:, 2] >= 0).all())
    texture = picture(files.bytes(material.picture)) if mapped and material.picture else None
    uv = obj.coordinates[rows[:, 1]] * (1, -1) + (0, 1) if texture is not None else None
    normals = obj.normals[rows[:, 2]] if shaded else np.zeros((1, 3))
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    yield Mesh(
        name, obj.vertices[rows[:, 0]].astype(np.float32), faces,
        None if uv is None else uv.astype(np.float32),
        (normals / length).astype(np.float32) if length.min() > 0 else None,
        (*((1.0, 1.0, 1.0) if texture is not None else material.colour), material.alpha),
        texture, material.specular, material.shininess,
    )  # fmt: skip


def _distinct(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distinct corners, int64 [N, 3], and the triangles of their rows, int32 [F, 3]."""
    flat = corners.reshape(-1, 3).astype(np.int64)
    _, vt, vn = flat.max(0) + 2
    _, first, inverse = np.unique(
        ((flat[:, 0] + 1) * vt + flat[:, 1] + 1) * vn + flat[:, 2] + 1,
        return_index=True, return_inverse=True,
    )  # fmt: skip
    return flat[first], inverse.reshape(-1, 3).astype(np.int32)


def picture(data: bytes | None) -> np.ndarray | None:
    """Decode a texture.

    Args:
        data: a file of a format that OpenCV reads; None where it is missing.

    Returns:
        uint8 [H, W, 3], or [H, W, 4] where it is transparent somewhere; sides of at most
        ``TEXTURE_SIDE``. None where it is missing or no picture.
    """
    if not data:
        return None
    found = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if found is None:
        return None
    if found.dtype == np.uint16:
        found = (found // 256).astype(np.uint8)
    channels = 1 if found.ndim == 2 else found.shape[2]
    to_rgb = {1: cv2.COLOR_GRAY2RGB, 3: cv2.COLOR_BGR2RGB, 4: cv2.COLOR_BGRA2RGBA}
    rgb = np.asarray(cv2.cvtColor(found, to_rgb[channels]))
    if channels == 4 and rgb[..., 3].min() >= 250:
        rgb = rgb[..., :3]
    height, width = (min(side, TEXTURE_SIDE) for side in rgb.shape[:2])
    if (height, width) != rgb.shape[:2]:
        rgb = np.asarray(cv2.resize(rgb, (width, height), interpolation=cv2.INTER_AREA))
    return np.ascontiguousarray(rgb, np.uint8)
