"""A store gives its scenes back, survives a full disk, and stays out of memory."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cfnav_core.scenes.scene import ARRAYS, OfflineScene, SceneError, changed_files
from cfnav_core.scenes.store import HEAD, StoreHead, open_store
from cfnav_core.scenes.store_writer import StoreWriter


def scene(name: str, positions: int = 2, width: int = 3, features=(4, 2)) -> OfflineScene:
    """A scene of random numbers that hang together."""
    rng = np.random.default_rng(len(name) + positions)
    states, objects = positions * 16, ("Book", "Mug", "Sink")
    return OfflineScene(
        name=name, room_type="kitchen", perception="p", source="s", objects=objects,
        goals=("Mug", "Sink"),
        features=rng.normal(size=(states, *features)).astype(np.float16),
        detections=rng.normal(size=(states, 3, width)).astype(np.float16),
        next_state=rng.integers(states, size=(states, 6)).astype(np.int32),
        collided=rng.random(states) < 0.3, visible=rng.random((states, 3)) < 0.2,
        position=np.repeat(np.arange(positions, dtype=np.int32), 16),
        heading=np.tile(np.repeat(np.arange(8, dtype=np.int8), 2), positions),
        horizon=np.tile(np.array([0, 1], np.int8), positions * 8),
        positions=rng.normal(size=(positions, 2)).astype(np.float32),
        instances=rng.integers(5, size=3).astype(np.int16),
        distance=rng.random((positions, 3)).astype(np.float32),
        fields=("score", "x", "y", "area")[:width],
    )  # fmt: skip


HERE = Path("/elsewhere")
THREE = [scene("FloorPlan1"), scene("FloorPlan20", 5), scene("FloorPlan400", 3)]
SPLITS = ("train", "train", "test")


def write(folder, scenes=THREE, writer=None):
    writer = writer or StoreWriter(folder, "data1", "drawn", HERE)
    for one in scenes:
        writer.append(one, SPLITS[THREE.index(one)])
    writer.finish()
    return folder


@pytest.fixture
def store(tmp_path):
    return write(tmp_path / "store")


def assert_same(found: OfflineScene, expected: OfflineScene) -> None:
    for key in ARRAYS:
        a, b = getattr(found, key), getattr(expected, key)
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
    for key in ("name", "room_type", "perception", "source", "objects", "goals"):
        assert getattr(found, key) == getattr(expected, key)


def test_scenes_come_back_as_slices_of_the_maps(store):
    opened = open_store(store)
    for found, expected in zip(opened, THREE, strict=True):
        assert_same(found, expected)
        for key in ARRAYS:
            assert isinstance(getattr(found, key), np.memmap)
    assert [p.name for p in store.parent.iterdir()] == ["store"]
    assert {p.name for p in store.iterdir()} == {HEAD, *(f"{key}.npy" for key in ARRAYS)}


def test_scenes_by_name_and_by_split(store):
    head = StoreHead.load(store)
    assert head.names("train") == ["FloorPlan1", "FloorPlan20"]
    assert head.names("validation") == []
    (last,) = open_store(store, head.names("test"))
    assert_same(last, THREE[2])
    assert [s.name for s in open_store(store, ["FloorPlan400", "FloorPlan1"])] == [
        "FloorPlan400", "FloorPlan1",
    ]  # fmt: skip
    with pytest.raises(SceneError, match=r"found no scene FloorPlan2 in .*FloorPlan20"):
        open_store(store, ["FloorPlan2"])


def test_rows_without_numbers(tmp_path):
    bare = [scene("FloorPlan1", width=0), scene("FloorPlan2", 4, width=0)]
    writer = StoreWriter(tmp_path / "s", "savn", "drawn", HERE)
    for one in bare:
        writer.append(one, "train")
    writer.finish()
    for found, expected in zip(open_store(tmp_path / "s"), bare, strict=True):
        assert_same(found, expected)


def test_an_interrupted_store_goes_on_behind_its_last_whole_scene(tmp_path, store):
    folder = tmp_path / "again"
    StoreWriter(folder, "data1", "drawn", HERE).append(THREE[0], "train")
    assert not folder.exists()
    # killed in the middle of the second scene
    for key in ("features", "visible", "distance"):
        with (tmp_path / "again.partial" / f"{key}.npy").open("ab") as file:
            file.write(b"half a scene")
    writer = StoreWriter(folder, "data1", "drawn", HERE)
    assert writer.head.names() == ["FloorPlan1"]
    write(folder, THREE[1:], writer)
    assert StoreHead.load(folder) == StoreHead.load(store)  # the hashes of all files too
    assert changed_files(folder, StoreHead.load(folder).sha256) == []


def test_killed_before_its_first_scene_was_whole(tmp_path, store):
    partial = tmp_path / "again.partial"
    partial.mkdir()
    (partial / "features.npy").write_bytes(b"half a scene")
    assert StoreHead.load(write(tmp_path / "again")) == StoreHead.load(store)


def test_what_does_not_belong_together_is_refused(tmp_path, store):
    with pytest.raises(SceneError, match=r"found .*store already; remove it"):
        StoreWriter(store, "data1", "drawn", HERE)
    writer = StoreWriter(tmp_path / "a", "data1", "drawn", HERE)
    with pytest.raises(SceneError, match="found no scenes"):
        writer.finish()
    writer.append(THREE[0], "train")
    with pytest.raises(SceneError, match="begun with drawn, in /elsewhere and not with painted, "):
        StoreWriter(tmp_path / "a", "data1", "painted", HERE)
    with pytest.raises(SceneError, match="begun with drawn, in /elsewhere and not with drawn, in"):
        StoreWriter(tmp_path / "a", "data1", "drawn", tmp_path)
    with pytest.raises(SceneError, match="found scene FloorPlan1 in the store already"):
        writer.append(THREE[0], "train")
    with pytest.raises(SceneError, match="found perception q in FloorPlan20, expected p as in"):
        writer.append(replace(THREE[1], perception="q"), "train")
    with pytest.raises(SceneError, match=r"found features .*\(9,\).*expected .*\(4, 2\)"):
        writer.append(scene("FloorPlan2", features=(9,)), "train")
    write(tmp_path / "a", THREE[1:], writer)
    assert_same(open_store(tmp_path / "a")[2], THREE[2])


def test_killed_before_it_got_its_name(store):
    head = StoreHead.load(store)
    assert head.made_from == "drawn"  # and not on which machine
    store.rename(store.with_name("store.partial"))
    StoreWriter(store, "data1", "drawn", HERE).finish()
    assert StoreHead.load(store) == head


def test_damaged_stores(store):
    path = store / "features.npy"
    data = path.read_bytes()
    path.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    sums = StoreHead.load(store).sha256
    assert changed_files(store, sums) == ["features"]
    path.write_bytes(data[:-1])
    with pytest.raises(SceneError, match="found no readable store"):
        open_store(store)
    np.save(path, np.zeros((3, 4, 2), np.float16))
    with pytest.raises(
        SceneError, match=r"found features.npy of shape \(3, 4, 2\) .*\(160, 4, 2\)"
    ):
        open_store(store)
    path.unlink()
    with pytest.raises(SceneError, match="found no readable store"):
        open_store(store)
    with pytest.raises(SceneError, match=r"found an unreadable array .*features\.npy"):
        changed_files(store, sums)


@pytest.mark.parametrize("text", ["{", "[]", '{"schema": 2}', '{"schema": 1}'])
def test_damaged_heads(store, text):
    (store / HEAD).write_text(text)
    with pytest.raises(SceneError, match=r"found no readable .*store\.json"):
        open_store(store)


def in_a_process(code: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", code, *map(str, arguments)]
    root = Path(__file__).parents[3]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=root)


FULL_DISK = """
import resource, sys
from pathlib import Path
from tests.core.published.test_store import HERE, THREE, StoreWriter
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
writer = StoreWriter(Path(sys.argv[1]), "data1", "drawn", HERE)
writer.append(THREE[0], "train")
try:
    writer.append(THREE[1], "train")
except ValueError as error:
    print(error)
"""


def test_a_full_disk_leaves_whole_scenes_and_one_sentence(tmp_path, store):
    folder = tmp_path / "full"
    # the kernel refuses to write files beyond 1700 bytes: the second scene's features
    done = in_a_process(FULL_DISK, folder, 1700)
    assert done.returncode == 0, done.stderr
    assert re.match(r"found no way to write .*full\.partial \(.*\); it holds 1 whole scenes: "
                    "make room", done.stdout)  # fmt: skip
    assert len(done.stdout.splitlines()) == 1
    assert not folder.exists()
    writer = StoreWriter(folder, "data1", "drawn", HERE)
    write(folder, THREE[1:], writer)
    assert StoreHead.load(folder) == StoreHead.load(store)


MEMORY = """
import resource, sys
from dataclasses import replace
from pathlib import Path
import numpy as np
from cfnav_core.scenes.store import StoreHead, open_store
from tests.core.published.test_store import HERE, StoreWriter, scene

def megabytes():
    (line,) = [x for x in open("/proc/self/status") if x.startswith("RssAnon")]
    return int(line.split()[1]) / 1024

one = scene("FloorPlan1", 8, features=(512, 7, 7))
before = megabytes()
writer = StoreWriter(Path(sys.argv[1]), "data1", "drawn", HERE)
most = 0.0
for i in range(10):
    writer.append(replace(one, name=f"FloorPlan{i}"), "train")
    most = max(most, megabytes() - before)
writer.finish()
most = max(most, megabytes() - before)
before = megabytes()
scenes = open_store(Path(sys.argv[1]))
seen = sum(float(s.features[i::40].astype(np.float32).sum()) for i, s in enumerate(scenes))
print(sum(s.features.nbytes for s in scenes) / 2**20, most, megabytes() - before)
"""


def test_memory_does_not_grow_with_the_store(tmp_path):
    done = in_a_process(MEMORY, tmp_path / "large")
    assert done.returncode == 0, done.stderr
    size, writing, reading = map(float, done.stdout.split())
    assert size > 60
    assert writing < 25  # one chunk and its copy, whatever the number of scenes
    assert reading < 5
    head = json.loads((tmp_path / "large" / HEAD).read_text())
    assert head["rows"]["features"] == ["<f2", [512, 7, 7]]
