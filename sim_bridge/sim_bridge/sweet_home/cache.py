"""Models as people load them: from the user's cache, made there at the first time.

A file for each model under ``$XDG_CACHE_HOME/cfnav/sweet_home``, by a version of what is in it, the
archive's size and time, and the entry; a damaged one is made anew. Whoever cannot write there reads
the archive each time.
"""

from __future__ import annotations

import hashlib
import os
import re
import tempfile
import zipfile
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path

import numpy as np

from sim_bridge.sweet_home.bands import Box
from sim_bridge.sweet_home.catalogue import Entry
from sim_bridge.sweet_home.model import Mesh, Model, build

MODELS_VERSION = 3
"""Rises when the same archive gives other meshes or boxes; a test holds it."""

ARRAYS = ("vertices", "faces", "uv", "normals", "texture")


def cache_folder() -> Path:
    """Where parsed models are kept; need not be there yet."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "cfnav/sweet_home"


def load(entry: Entry, apart: Collection[str] = ()) -> Model:
    """A model, from the cache where it is there.

    Args:
        entry: of the model.
        apart: see ``build``.

    Raises:
        SweetHomeError: as ``build``.
    """
    path = _path(entry, apart)
    with suppress(OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return _read(path, entry)
    model = build(entry, apart)
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        # a folder of its own: processes that make the same model do not meet
        with tempfile.TemporaryDirectory(dir=path.parent) as own:
            _write(Path(own) / path.name, model)
            (Path(own) / path.name).replace(path)
    return model


def _path(entry: Entry, apart: Collection[str]) -> Path:
    state = entry.archive.stat() if entry.archive.exists() else None
    made_of = (MODELS_VERSION, entry, *sorted(apart), state and (state.st_size, state.st_mtime_ns))
    digest = hashlib.sha256(repr(made_of).encode()).hexdigest()[:16]
    return cache_folder() / f"{re.sub(r'[^A-Za-z0-9]+', '-', entry.id)}-{digest}.npz"


def _write(path: Path, model: Model) -> None:
    arrays = {
        f"{name}{i}": array
        for i, mesh in enumerate(model.meshes)
        for name in ARRAYS
        if (array := getattr(mesh, name)) is not None
    }
    looks = [(*mesh.colour, mesh.specular, mesh.shininess) for mesh in model.meshes]
    boxes = np.array([(*box.centre, *box.half) for box in model.boxes]).reshape(-1, 6)
    names = np.array([mesh.name for mesh in model.meshes], np.str_)
    np.savez(path, allow_pickle=False, looks=np.array(looks), boxes=boxes, names=names, **arrays)


def _read(path: Path, entry: Entry) -> Model:
    with np.load(path, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    meshes = []
    names = arrays["names"].tolist()
    for i, look in enumerate(arrays["looks"].tolist()):
        vertices, faces, uv, normals, texture = (arrays.get(f"{name}{i}") for name in ARRAYS)
        if vertices is None or faces is None:
            raise KeyError(i)
        red, green, blue, alpha, specular, shininess = look
        colour = (red, green, blue, alpha)
        meshes.append(
            Mesh(names[i], vertices, faces, uv, normals, colour, texture, specular, shininess)
        )
    boxes = [Box((a, b, c), (d, e, f)) for a, b, c, d, e, f in arrays["boxes"].tolist()]
    return Model(entry.id, entry.size, tuple(meshes), tuple(boxes))
