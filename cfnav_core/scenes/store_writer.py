"""Writes a store scene by scene, without ever holding more than a few rows in memory.

It grows in ``<folder>.partial`` and is renamed when complete, so that a folder of its name is
always whole. An interrupted one goes on behind its last whole scene.
"""

from __future__ import annotations

import hashlib
import io
import os
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from cfnav_core.scenes.scene import ARRAYS, OfflineScene, SceneError
from cfnav_core.scenes.store import HEAD, StoredScene, StoreHead, to_disk

CHUNK_BYTES = 1 << 24


class StoreWriter:
    """Writes a store scene by scene.

    Args:
        folder: of the store; must not be there yet.
        layout: name of the published data set, or ``BUILT_IN``.
        made_from: what the store is made from and how.
        origin: folder that this lies in. An interrupted store goes on with the same only; a
            finished one travels and does not name it.

    Raises:
        SceneError: the folder is there, or an interrupted store of something else.
    """

    def __init__(self, folder: Path, layout: str, made_from: str, origin: Path) -> None:
        self.folder, self.partial = folder, folder.with_name(folder.name + ".partial")
        self.made_from = made_from
        begun_with = f"{made_from}, in {origin.resolve()}"
        self.head = StoreHead(layout, begun_with)
        if folder.exists():
            raise SceneError(f"found {folder} already; remove it or name another folder")
        if (self.partial / HEAD).exists():
            self.head = StoreHead.load(self.partial)
            # ended before it got its name, it says no more where it comes from
            if self.head.made_from not in (begun_with, made_from):
                raise SceneError(
                    f"found {self.partial}, begun with {self.head.made_from} and not with "
                    f"{begun_with}; remove it or name another folder"
                )
        self.partial.mkdir(parents=True, exist_ok=True)
        self._cut()

    def append(self, scene: OfflineScene, split: str) -> None:
        """Add a scene.

        Args:
            scene: of the same perception, source, objects and shapes as those before it.
            split: train, validation or test.

        Raises:
            SceneError: it does not fit, or the disk is full; the scenes before it stay whole.
        """
        head = _with_scene(self.head, scene, split)
        try:
            for key in ARRAYS:
                with (self.partial / f"{key}.npy").open("ab") as file:
                    if not self.head.scenes:
                        file.write(_header(head, key))
                    _write(file, _array(scene, key))
            head.save(self.partial)
        except OSError as error:
            self._cut()
            raise self.full(error) from error
        self.head = head

    def finish(self) -> None:
        """Give the arrays their final lengths and hashes, and the folder its name.

        Raises:
            SceneError: there is no scene, or the disk is full.
        """
        if not self.head.scenes:
            raise SceneError(f"found no scenes for {self.folder}; a store has at least one")
        try:
            sums = {}
            for key in ARRAYS:
                with (self.partial / f"{key}.npy").open("r+b") as file:
                    file.write(_header(self.head, key))
                    to_disk(file)
                    file.seek(0)
                    sums[key] = hashlib.file_digest(file, "sha256").hexdigest()
            self.head = replace(self.head, made_from=self.made_from, sha256=sums)
            self.head.save(self.partial)
            self.partial.replace(self.folder)
        except OSError as error:
            raise self.full(error) from error

    def _cut(self) -> None:
        """Take off what belongs to no whole scene."""
        for path in self.partial.glob("*.npy"):
            if self.head.scenes:
                shape, dtype = self.head.shape(path.stem), np.dtype(self.head.rows[path.stem][0])
                size = len(_header(self.head, path.stem)) + int(np.prod(shape)) * dtype.itemsize
                if path.stat().st_size < size:
                    raise SceneError(f"found {path} shorter than {HEAD} says; "
                                     f"remove {self.partial} and begin again")  # fmt: skip
                os.truncate(path, size)
            else:
                path.unlink()

    def full(self, error: OSError) -> SceneError:
        """What to say when nothing more can be written."""
        return SceneError(
            f"found no way to write {self.partial} ({error}); it holds {len(self.head.scenes)} "
            "whole scenes: make room and run the same command again, or remove it"
        )


def _array(scene: OfflineScene, key: str) -> np.ndarray:
    """What is appended of a scene."""
    value: np.ndarray = getattr(scene, key)
    return value[None] if key == "instances" else value


def _header(head: StoreHead, key: str) -> bytes:
    """Of the file of an array; numpy leaves room for any number of rows, so it never grows."""
    out = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        out, {"descr": head.rows[key][0], "fortran_order": False, "shape": head.shape(key)}
    )
    return out.getvalue()


def _write(file: BinaryIO, array: np.ndarray) -> None:
    """Append rows, a few at a time, and have them on the disk."""
    step = max(1, CHUNK_BYTES // max(1, array[:1].nbytes))
    for i in range(0, len(array), step):
        file.write(np.ascontiguousarray(array[i : i + step]).tobytes())
    to_disk(file)


ALIKE = ("perception", "source", "objects", "fields", "camera")
"""What all scenes of a store have alike."""


def _with_scene(head: StoreHead, scene: OfflineScene, split: str) -> StoreHead:
    """The head with one more scene; SceneError when it does not fit to the others."""
    arrays = {key: _array(scene, key) for key in ARRAYS}
    rows = {key: (a.dtype.str, a.shape[1:]) for key, a in arrays.items()}
    if scene.name in head.names():
        raise SceneError(f"found scene {scene.name} in the store already")
    if head.scenes:
        found = {key: getattr(scene, key) for key in ALIKE}
        for what, value in {**found, **rows}.items():
            expected = head.rows[what] if what in rows else getattr(head, what)
            if value != expected:
                raise SceneError(
                    f"found {what} {value} in {scene.name}, expected {expected} as in "
                    f"{head.scenes[0].name}; a store holds scenes of one kind"
                )
    here = StoredScene(
        scene.name, scene.room_type, split, scene.goals,
        first=sum(s.states for s in head.scenes), states=scene.num_states,
        first_position=sum(s.positions for s in head.scenes), positions=len(scene.positions),
    )  # fmt: skip
    return replace(
        head, rows=rows, scenes=(*head.scenes, here), **{key: getattr(scene, key) for key in ALIKE}
    )  # fmt: skip
