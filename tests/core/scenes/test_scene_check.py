"""Whatever is wrong with a scene on disk is said once, with its file and its state."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cfnav_core.scenes.check import check_rooms, check_store
from cfnav_core.scenes.scene import OfflineScene
from cfnav_core.scenes.store_writer import StoreWriter
from cfnav_core.task.actions import NUM_ACTIONS
from cfnav_core.task.rooms import room_folder
from tests.core.worlds import hall

SCENES = [hall(4, 3, name="kitchen:0"), hall(5, 3, seed=1, name="kitchen:1")]


def folder_of(folder: Path, scenes: list[OfflineScene]) -> Path:
    for scene in scenes:
        kind, seed = scene.name.split(":")
        scene.save(room_folder(folder, kind, int(seed)))
    return folder


def store_of(folder: Path, scenes: list[OfflineScene]) -> Path:
    writer = StoreWriter(folder, "data2", "drawn", folder)
    for scene in scenes:
        writer.append(scene, "train")
    writer.finish()
    return folder


@pytest.fixture(params=[check_rooms, check_store], ids=["rooms", "store"])
def check(request, tmp_path):
    """Writes scenes and looks through them; both kinds of folders."""
    make = folder_of if request.param is check_rooms else store_of
    return lambda scenes: request.param(make(tmp_path / "made", scenes))


def test_intact_scenes(check):
    assert check(SCENES) == []


@pytest.mark.parametrize(
    ("key", "rows", "message"),
    [("features", (7, 9), "2 states in FOLDER/features.npy are not finite, first state 7 of "),
     ("detections", (3,), "1 states in FOLDER/detections.npy are not finite, first state 3 of "),
     ("positions", (2,), "1 positions in FOLDER/positions.npy are not finite, first position 2 "
                         "of "),
     ("collided", (0,), "1 states in FOLDER/collided.npy contradict next_state.npy, first state 0 "
                        "of ")],
)  # fmt: skip
def test_wrong_numbers(check, key, rows, message):
    array = getattr(SCENES[1], key).copy()
    array[list(rows)] = ~array[list(rows)] if array.dtype == bool else np.nan
    (line,) = check([SCENES[0], replace(SCENES[1], **{key: array})])
    assert re.match(message.replace("FOLDER", ".*made.*") + "kitchen:1; .* again$", line), line


def test_no_target_can_be_reached(check):
    states = np.arange(SCENES[1].num_states, dtype=np.int32)
    stuck = replace(
        SCENES[1], next_state=np.tile(states[:, None], NUM_ACTIONS), collided=states >= 0
    )
    (line,) = check([SCENES[0], stuck])
    assert line.startswith("no target of kitchen:1 can be reached (visible from anywhere: Laptop")


@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("key", ["features", "next_state"])
def test_changed_bytes(tmp_path, key, quick):
    rooms, store = folder_of(tmp_path / "rooms", SCENES), store_of(tmp_path / "store", SCENES)
    for path in (rooms / "kitchen_00001" / f"{key}.npy", store / f"{key}.npy"):
        data = path.read_bytes()
        path.write_bytes(data[:-1] + bytes([data[-1] ^ 64]))
        lines = check_store(store, quick) if path.parent == store else check_rooms(rooms, quick)
        # a wild edge is seen by its range too
        expected = [f"found {path} changed"] * (not quick) + ["found a next"] * (key != "features")
        assert [" ".join(line.split()[:3]) for line in lines] == expected


def test_what_is_gone_leaves_the_others_checked(tmp_path):
    rooms = folder_of(tmp_path, SCENES)
    (rooms / "kitchen_00000/features.npy").unlink()
    (rooms / "kitchen_00001/visible.npy").write_bytes(b"x")
    first, *others = check_rooms(rooms)
    assert "kitchen_00000" in first
    assert "No such file" in first
    assert len(others) == 2
    assert all("kitchen_00001" in line for line in others)
    (rooms / "kitchen_00001/scene.json").write_text("{")
    assert ["kitchen_00001" in line for line in check_rooms(rooms)] == [False, True]


def test_rooms_that_are_not_finished(tmp_path):
    rooms = folder_of(tmp_path, SCENES)
    (rooms / "kitchen_00001").rename(rooms / "kitchen_00001.partial")
    (rooms / "bedroom_00004").mkdir()
    assert check_rooms(rooms) == [
        f"2 folders in {rooms} are no finished rooms, first bedroom_00004"
    ]


def test_scenes_that_do_not_belong_together(tmp_path):
    others = [replace(SCENES[1], perception="other"), hall(4, 4, name="kitchen:2")]
    rooms = folder_of(tmp_path, [SCENES[0], *others])
    (rooms / "kitchen_00002").rename(rooms / "kitchen_00009")
    alike, name = check_rooms(rooms)
    assert alike == ("1 scenes were not made with perception test and program test as most were, "
                     "first kitchen:1")  # fmt: skip
    assert name.startswith(f"found kitchen:2 in {rooms}/kitchen_00009, expected kitchen:9")


FULL_DISK = """
import resource, sys
from pathlib import Path
from tests.core.worlds import hall
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
try:
    hall().save(Path(sys.argv[1]))
except OSError as error:
    print(error)
"""


def test_a_full_disk_leaves_the_scene_that_was_there(tmp_path):
    folder = tmp_path / "kitchen_00000"
    SCENES[0].save(folder)
    before = {p.name: p.read_bytes() for p in folder.iterdir()}
    # the kernel refuses to write files beyond so many bytes
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(folder), "30000"],
        capture_output=True, text=True, check=True, timeout=300, cwd=Path(__file__).parents[3],
    )  # fmt: skip
    assert re.fullmatch(r"found no way to write .*kitchen_00000 \(.*\); make room and "
                        r"run the same command again\n", done.stdout)  # fmt: skip
    assert [p.name for p in tmp_path.iterdir()] == ["kitchen_00000"]
    assert {p.name: p.read_bytes() for p in folder.iterdir()} == before
