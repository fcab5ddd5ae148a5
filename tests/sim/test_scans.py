"""Scans of every state of a room, and what the LiDAR node makes of them."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cfnav_ros.lidar import states as lidar_states
from sim_bridge.data import scans
from sim_bridge.room.room import generate_room, room_source
from sim_bridge.world.grid import StateGrid, state_grid
from sim_bridge.world.world import World

from cfnav import cli
from cfnav_core.files.provenance import sign
from cfnav_core.scenes.scene import HORIZONS, LIDAR, SCANS, OfflineScene
from cfnav_core.task.calibration import auc
from cfnav_core.task.rooms import room_folder
from tests.core.worlds import hall

ROOM = "bathroom:3"


@pytest.fixture(scope="module")
def grid() -> StateGrid:
    return state_grid(World(generate_room("bathroom", 3)))


@pytest.fixture(scope="module")
def scenes(grid: StateGrid, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the scene of a bathroom, of pictures nothing."""
    folder = tmp_path_factory.mktemp("rooms")
    states, of = len(grid.next_state), hall()
    scene = replace(
        of, name=ROOM, room_type="bathroom", source=room_source("bathroom"),
        features=np.zeros((states, 4), np.float16),
        detections=np.zeros((states, len(of.objects), 5), np.float16),
        next_state=grid.next_state, collided=grid.collided,
        visible=np.zeros((states, len(of.objects)), bool), position=grid.position,
        heading=grid.heading, horizon=grid.horizon, positions=grid.positions,
        distance=np.zeros((len(grid.positions), len(of.objects)), np.float32),
    )  # fmt: skip
    scene.save(room_folder(folder, "bathroom", 3))
    scans.run(scans.ScanOptions(folder, [ROOM]))
    return folder


def test_rooms_that_another_version_scanned_or_judged_are_made_again(scenes: Path) -> None:
    room = room_folder(scenes, "bathroom", 3)
    lidar_states.run(lidar_states.EstimateOptions(scenes))

    def again(path: Path) -> bool:
        before = path.stat().st_mtime_ns
        scans.run(scans.ScanOptions(scenes, [ROOM]))
        lidar_states.run(lidar_states.EstimateOptions(scenes))
        return path.stat().st_mtime_ns > before

    assert not again(room / SCANS)
    assert not again(room / LIDAR)
    sign(room / LIDAR, "older")
    assert again(room / LIDAR)
    sign(room / SCANS, "older")
    assert again(room / SCANS)


def test_a_wall_ahead_is_where_the_driver_says(scenes: Path, grid: StateGrid) -> None:
    turns = np.load(room_folder(scenes, "bathroom", 3) / SCANS)
    assert turns.shape == (len(grid.positions), 8, 1080)
    # heading by heading the same surroundings, turned by 45 of 359 degrees
    near = np.nanmedian(np.where(np.isfinite(turns), turns, np.nan), axis=2)
    assert np.ptp(near, axis=1).max() < 0.3
    assert near.max() < 4


def test_probabilities_tell_collisions(scenes: Path, grid: StateGrid) -> None:
    assert lidar_states.run(lidar_states.EstimateOptions(scenes)) == 1
    p = np.load(room_folder(scenes, "bathroom", 3) / LIDAR)
    assert p.shape == grid.collided.shape
    assert p.dtype == np.float32
    np.testing.assert_array_equal(p[::HORIZONS], p[1::HORIZONS])
    assert auc(p, grid.collided) > 0.97
    assert ((p >= 0.5) == grid.collided).mean() > 0.9


def test_the_longer_way_on_diagonals_is_judged(scenes: Path, grid: StateGrid) -> None:
    """A diagonal of the grid is 0.354 m long, and what stands 0.3 m ahead is in the way of it."""
    lidar_states.run(lidar_states.EstimateOptions(scenes))
    p = np.load(room_folder(scenes, "bathroom", 3) / LIDAR)
    for diagonal in (0, 1):
        blocked = grid.collided & (grid.heading % 2 == diagonal)
        assert (p[blocked] >= 0.5).mean() > 0.93


def test_rooms_that_were_scanned_are_not_scanned_again(scenes: Path) -> None:
    path = room_folder(scenes, "bathroom", 3) / SCANS
    before = path.stat().st_mtime_ns
    scans.run(scans.ScanOptions(scenes, [ROOM]))
    assert path.stat().st_mtime_ns == before


def test_only_rooms_that_were_asked_for_are_scanned(
    scenes: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["cfnav", "rooms", "scan", str(scenes), "--rooms", ROOM])
    assert cli.main() == 0  # 2 where it looks for others, which are not there


def test_a_scene_of_another_version_is_refused(scenes: Path, tmp_path: Path) -> None:
    scene = OfflineScene.load(room_folder(scenes, "bathroom", 3))
    with pytest.raises(ValueError, match=r"made by another version.*--rooms bathroom:4"):
        scans.turns(replace(scene, name="bathroom:4"), 1.0)
    # other things may stand there and stop the robot alike
    with pytest.raises(ValueError, match=r"\(rooms 0, today's is rooms 1\).*--rooms bathroom:3"):
        scans.turns(replace(scene, source="rooms 0"), 1.0)
    scans.turns(replace(scene, source=f"{scene.source} shifted by 0.5"), 1.0, most=1)
    with pytest.raises(ValueError, match=r"found no scans\.npy"):
        lidar_states.run(lidar_states.EstimateOptions(tmp_path))


def test_new_scans_leave_no_estimates_of_the_old_ones(scenes: Path, tmp_path: Path) -> None:
    shutil.copytree(scenes, tmp_path, dirs_exist_ok=True)
    room = room_folder(tmp_path, "bathroom", 3)
    lidar_states.run(lidar_states.EstimateOptions(tmp_path))
    assert (room / LIDAR).exists()
    scans.run(scans.ScanOptions(tmp_path, [ROOM], noise=0.0))
    assert not (room / LIDAR).exists()
