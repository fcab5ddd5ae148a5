"""One root of each published layout, written once; tests that damage one copy a scene of it."""

import shutil

import pytest

from . import drawn


@pytest.fixture(scope="session")
def data1(tmp_path_factory):
    root = tmp_path_factory.mktemp("data1") / "Scene_Data"
    drawn.write_data1(root / "FloorPlan1")
    drawn.write_data1(
        root / "FloorPlan422", "det_feature_60_categories.hdf5", drawn.SIXTY,
        edges="edges", minus_zero=True,
    )  # fmt: skip
    return root


@pytest.fixture(scope="session")
def data2(tmp_path_factory):
    root = tmp_path_factory.mktemp("data2") / "data/thor_v1_offline_data"
    drawn.write_data2(root / "FloorPlan219", by_state=True)
    drawn.write_data2(root / "FloorPlan230")
    return root


@pytest.fixture(scope="session")
def savn(tmp_path_factory):
    root = tmp_path_factory.mktemp("savn") / "thor_offline_data"
    drawn.write_savn(root / "FloorPlan2_physics")
    drawn.write_savn(root / "FloorPlan402")
    return root


@pytest.fixture
def own1(data1, tmp_path):
    """A scene of Data 1 to damage."""
    shutil.copytree(data1 / "FloorPlan1", tmp_path / "FloorPlan1")
    return tmp_path


@pytest.fixture
def own2(data2, tmp_path):
    shutil.copytree(data2 / "FloorPlan230", tmp_path / "FloorPlan230")
    return tmp_path
