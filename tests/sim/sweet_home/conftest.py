"""Folders of furniture made by the tests: four archives like those of the Debian package."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import cv2
import numpy as np
import pytest
from sim_bridge.sweet_home.catalogue import ARCHIVES, PROPERTIES, VARIABLE

Furnish = Callable[..., Path]

# A board 2 wide, 1 high, 0.2 deep: front (towards +z of the file) in one quad, the rest beside it.
BOARD = """mtllib board.mtl
v -1 0 0.1
v 1 0 0.1
v 1 1 0.1
v -1 1 0.1
v -1 0 -0.1
v 1 0 -0.1
v 1 1 -0.1
v -1 1 -0.1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl front
f 1/1 2/2 3/3 4/4
usemtl rest
f -3 -4 -1 -2
f 1 4 8 5
f 2 6 7 3
f 4 3 7 8
f 1 5 6 2
"""
BOARD_MTL = """newmtl front
Kd 0.1 0.1 0.1
map_Kd Front.png
newmtl rest
Kd 0 1 0
Ks 0.5 0.5 0.5
Ns 64
"""
FIELDS = {
    "id": "Test#board", "name": "Board", "category": "Office", "model": "/test/board.obj",
    "width": "40", "depth": "4", "height": "20", "creator": "Somebody",
}  # fmt: skip


def png(rgb: np.ndarray) -> bytes:
    """A picture's file: uint8 [H, W, 3 or 4]."""
    order = [2, 1, 0, 3][: rgb.shape[2]]
    return cv2.imencode(".png", np.ascontiguousarray(rgb[..., order]))[1].tobytes()


def quarters() -> np.ndarray:
    """uint8 [8, 8, 3]: red and green above, blue and white below."""
    out = np.full((8, 8, 3), 255, np.uint8)
    out[:4, :4], out[:4, 4:], out[4:, :4] = (255, 0, 0), (0, 255, 0), (0, 0, 255)
    return out


def board_files(**others: bytes | str) -> dict[str, bytes | str]:
    """The files of the board; "." in names is written "_"."""
    files = {"board_obj": BOARD, "board_mtl": BOARD_MTL, "front_png": png(quarters())} | others
    return {f"test/{name.replace('_', '.')}": content for name, content in files.items()}


@pytest.fixture
def furnish(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Furnish:
    """A function that makes a folder of archives and lets the project look there.

    The first archive has the given entries and files, the others are empty. The cache is the
    test's own.
    """
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))

    def make(
        *entries: Mapping[str, str], files: Mapping[str, bytes | str] | None = None, head: str = ""
    ) -> Path:
        folder = tmp_path / "furniture"
        folder.mkdir(exist_ok=True)
        rows = [
            f"{key}#{i}={value}"
            for i, entry in enumerate(entries or ({},), 1)
            for key, value in (FIELDS | dict(entry)).items()
        ]
        for name in ARCHIVES:
            with zipfile.ZipFile(folder / f"{name}.sh3f", "w") as archive:
                first = name == ARCHIVES[0]
                text = "\n".join(["# made by a test", "license=None at all", head, *rows])
                archive.writestr(PROPERTIES, text.encode("latin-1") if first else "")
                for path, content in (board_files() if files is None else files).items():
                    if first:
                        archive.writestr(path, content)
        monkeypatch.setenv(VARIABLE, str(folder))
        return folder

    return make
