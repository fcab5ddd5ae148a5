"""Archives of ours: the same models, read by the same reader."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest
from sim_bridge.sweet_home import catalogue as catalogues
from sim_bridge.sweet_home.catalogue import catalogue, shipped
from sim_bridge.sweet_home.model import Model, build
from sim_bridge.sweet_home.pack import pack

from tests.sim.sweet_home.conftest import board_files, png

CLEAR = np.dstack([np.full((8, 8, 3), 90, np.uint8), np.eye(8, dtype=np.uint8) * 255])
ENTRIES = (
    {"dropOnTopElevation": "-1", "elevation": "75.5", "creator": "Zoë = & Co"},
    {"id": "Test#turned", "modelRotation": "1 0 0 0 0 1 0 -1 0", "dropOnTopElevation": "3"},
)


def packed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = folder / "packed.sh3f"
    pack([(entry, {"front": "Pillow"}) for entry in catalogue().values()], path)
    monkeypatch.setattr(catalogues, "SHIPPED", path)
    return path


def corners(model: Model, name: str) -> np.ndarray:
    meshes = [mesh for mesh in model.meshes if mesh.name == name]
    found = np.concatenate([mesh.vertices[mesh.faces].reshape(-1, 9) for mesh in meshes])
    return found[np.lexsort(np.round(found, 3).T)]


@pytest.mark.parametrize("see_through", [False, True])
def test_a_packed_model_is_the_same(furnish, tmp_path, monkeypatch, see_through):
    furnish(*ENTRIES, files=board_files(**({"front_png": png(CLEAR)} if see_through else {})))
    packed(tmp_path, monkeypatch)
    before, after = catalogue(), shipped()
    assert list(after) == list(before)
    for name, entry in after.items():
        old = before[name]
        assert (entry.size, entry.elevation, entry.drop_on_top) == (
            old.size, old.elevation, old.drop_on_top
        )  # fmt: skip
        assert (entry.name, entry.creator, entry.licence) == (old.name, old.creator, "CC0-1.0")
        was, now = build(old, {"front"}), build(entry, {"front"})
        for part in ("front", ""):
            np.testing.assert_allclose(corners(now, part), corners(was, part), atol=2e-4)
        for mesh, old_mesh in zip(now.meshes, was.meshes, strict=True):
            assert mesh.colour == pytest.approx(old_mesh.colour, abs=1e-3)
            assert mesh.specular == pytest.approx(old_mesh.specular, abs=1e-3)
            assert mesh.shininess == pytest.approx(old_mesh.shininess, abs=1e-3)
            assert (mesh.normals is None) == (old_mesh.normals is None)
            assert (mesh.texture is None) == (old_mesh.texture is None)
            if mesh.texture is not None and old_mesh.texture is not None:
                assert mesh.texture.shape == old_mesh.texture.shape
                pictures = mesh.texture.astype(int), old_mesh.texture.astype(int)
                assert np.abs(np.subtract(*pictures)).mean() < (1 if see_through else 25)
                uv = dict(zip(map(tuple, mesh.vertices.round(3).tolist()), mesh.uv, strict=True))
                for vertex, at in zip(old_mesh.vertices, old_mesh.uv, strict=True):
                    np.testing.assert_allclose(uv[tuple(vertex.round(3).tolist())], at, atol=1e-3)


def test_the_same_models_make_the_same_file(furnish, tmp_path, monkeypatch):
    furnish(*ENTRIES)
    first = packed(tmp_path, monkeypatch).read_bytes()
    assert packed(tmp_path, monkeypatch).read_bytes() == first
    with zipfile.ZipFile(tmp_path / "packed.sh3f") as archive:
        pictures = [name for name in archive.namelist() if name.startswith("textures/")]
    assert len(pictures) == 1  # both boards have it
