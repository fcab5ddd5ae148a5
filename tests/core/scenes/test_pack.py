"""Built-in scenes as one store: the same scenes, found by the same names."""

from dataclasses import replace

import numpy as np
import pytest

from cfnav_core.scenes.pack import pack
from cfnav_core.scenes.scene import SceneError
from cfnav_core.scenes.select import open_scenes, scene_names
from cfnav_core.scenes.store import HEAD, StoreHead
from cfnav_core.task.rooms import room_folder
from tests.core.published.test_store import assert_same
from tests.core.worlds import hall

ROOMS = (("kitchen", 0), ("kitchen", 20), ("bathroom", 3), ("bathroom", 18), ("bathroom", 21))


@pytest.fixture
def rooms(tmp_path):
    for kind, seed in ROOMS:
        scene = hall(4, 3, seed=seed, name=f"{kind}:{seed}")
        scene.save(room_folder(tmp_path / "rooms", kind, seed))
    return tmp_path / "rooms"


def test_the_same_scenes_by_the_same_names(rooms, tmp_path):
    store = tmp_path / "store"
    head = pack(rooms, "data2", store)
    assert head == StoreHead.load(store)
    assert str(tmp_path) not in (store / HEAD).read_text()
    for named in (["data2:test"], ["bathroom:3", "kitchen:0"], ["data1:validation", "data2:test"]):
        names = [n for n in scene_names(rooms, named) if n in head.names()]
        for found, expected in zip(
            open_scenes(store, names), open_scenes(rooms, names), strict=True
        ):
            assert_same(found, expected)
    assert scene_names(store, ["test"]) == ["kitchen:20", "bathroom:21"]
    assert scene_names(store, ["validation", "bathroom:18"]) == ["bathroom:18"]
    assert scene_names(store) == ["kitchen:0", "kitchen:20", "bathroom:3", "bathroom:18",
                                  "bathroom:21"]  # fmt: skip
    assert pack(rooms, "data1", tmp_path / "other").names("validation") == ["kitchen:20"]
    with pytest.raises(SceneError, match=r"no scene kitchen:9 in .*kitchen:20"):
        open_scenes(store, ["kitchen:9"])
    with pytest.raises(ValueError, match="found rooms 'FloorPlan1'; expected TYPE:SEED"):
        open_scenes(store, ["FloorPlan1"])


def test_a_damaged_scene_is_refused_and_packing_goes_on_once_it_is_mended(rooms, tmp_path):
    path = rooms / "bathroom_00018/features.npy"
    whole = path.read_bytes()
    path.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
    with pytest.raises(SceneError, match=r"features.npy changed since it was written; remove"):
        pack(rooms, "data2", tmp_path / "store")
    assert not (tmp_path / "store").exists()
    path.write_bytes(whole)
    with pytest.raises(SceneError, match="begun with built-in rooms, split as data2, in"):
        pack(rooms, "data1", tmp_path / "store")
    assert len(pack(rooms, "data2", tmp_path / "store").scenes) == len(ROOMS)
    np.testing.assert_array_equal(
        open_scenes(tmp_path / "store", ["bathroom:18"])[0].features,
        hall(4, 3, seed=18).features,
    )


def test_a_room_of_no_split_is_named(rooms, tmp_path):
    hall(name="kitchen:30").save(rooms / "kitchen_00030")
    with pytest.raises(SceneError, match=r"found kitchen:30 in .* no split of data1 \(1 such\)"):
        pack(rooms, "data1", tmp_path / "store")
    assert not list(tmp_path.glob("store*"))


def test_rooms_of_another_furniture_make_a_store_of_their_own(rooms, tmp_path):
    other = tmp_path / "other"
    for folder, seed in ((other, 300), (other, 100), (rooms, 0), (rooms, 20)):
        scene = hall(4, 3, seed=seed, name=f"sweet_home.kitchen:{seed}")
        scene = replace(scene, source="models", room_type="kitchen")
        scene.save(room_folder(folder, "sweet_home.kitchen", seed))
    head = pack(other, "worlds", tmp_path / "store")
    assert head.names() == ["sweet_home.kitchen:100", "sweet_home.kitchen:300"]
    assert scene_names(tmp_path / "store", ["test"]) == ["sweet_home.kitchen:300"]
    with pytest.raises(SceneError, match=r"found rooms of built_in and sweet_home furniture in "):
        pack(rooms, "data2", tmp_path / "both")
    assert not list(tmp_path.glob("both*"))
