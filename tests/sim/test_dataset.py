import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from sim_bridge.data import boxes
from sim_bridge.data.dataset import Look, RoomOptions, render_scene, render_views, run
from sim_bridge.room.room import generate_room
from sim_bridge.world.camera import Camera
from sim_bridge.world.grid import state_grid
from sim_bridge.world.visual_shift import shifted
from sim_bridge.world.world import World

from cfnav_core.files.provenance import note_of
from cfnav_core.perception.net import PerceptionNet, export_perception
from cfnav_core.perception.perception import BUILT_IN, OnnxPerception
from cfnav_core.perception.picture_set import PictureSet
from cfnav_core.perception.sight import Sight
from cfnav_core.scenes.check import check_rooms
from cfnav_core.scenes.scene import PICTURES, OfflineScene
from cfnav_core.task.camera import CAMERAS, MAST
from cfnav_core.task.vocabulary import CATEGORIES


@pytest.fixture(scope="module")
def perception(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("p") / "perception.onnx"
    torch.manual_seed(0)
    export_perception(PerceptionNet(), path)
    return path


def test_scene_holds_what_the_camera_sees(tmp_path, perception, capsys):
    options = RoomOptions(
        ["bathroom:0"],
        tmp_path,
        perception,
        keep_pictures=True,
        processes=1,
        camera="stock_preview",
    )
    set_up = CAMERAS["stock_preview"]
    run(replace(options, visual_shift=1.0, out=tmp_path / "dark"))
    dark = OfflineScene.load(tmp_path / "dark" / "bathroom_00000")
    dark_features = np.array(dark.features)
    world = World(generate_room("bathroom", 0), mast=False)
    grid, observe = state_grid(world, set_up.horizons), OnnxPerception(perception)
    with Camera(world, set_up) as camera:
        picture = BUILT_IN.preprocess(shifted(camera.rgb(grid.pose(7)), 1.0))
    seen = observe(picture[None])
    np.testing.assert_allclose(dark_features[7], seen.features[0], atol=2e-3)
    # by another light the same room looks different
    run(options)
    scene = OfflineScene.load(tmp_path / "bathroom_00000")
    np.testing.assert_array_equal(scene.next_state, grid.next_state)
    np.testing.assert_array_equal(scene.next_state, dark.next_state)
    with Camera(world, set_up) as camera:
        for state in (0, 7, scene.num_states - 1):
            pose = grid.pose(state)
            seen = observe(BUILT_IN.preprocess(camera.rgb(pose))[None])
            np.testing.assert_allclose(scene.features[state], seen.features[0], atol=2e-3)
            np.testing.assert_array_equal(
                scene.visible[state], camera.visible_categories(pose, camera.owner_pixels(pose))
            )
    features = np.array(scene.features)
    # another run renders nothing
    capsys.readouterr()
    run(options)
    said = capsys.readouterr().out
    assert "1 were there already" in said
    assert "perception.onnx learnt from another camera than stock_preview" in said
    # goals that this camera hardly sees are left out, and it says so
    often = {name for name, n in zip(scene.objects, scene.visible.sum(0), strict=True) if n >= 4}
    assert set(scene.goals) == often
    assert "Mirror" not in often
    assert f"{len(often)} of {len(world.room.goals)} goals of 1 rooms are asked for" in said
    assert "  Mirror is left out in 1 of 1: never seen in 1" in said
    # a room that was damaged since is made again
    (tmp_path / "bathroom_00000/collided.npy").write_bytes(b"")
    run(options)
    assert "0 were there already" in capsys.readouterr().out
    shutil.rmtree(tmp_path / "dark")
    assert check_rooms(tmp_path) == []
    np.testing.assert_array_equal(OfflineScene.load(tmp_path / "bathroom_00000").features, features)
    # another perception makes features again from the pictures
    torch.manual_seed(1)
    export_perception(PerceptionNet(), tmp_path / "other.onnx")
    run(replace(options, perception=tmp_path / "other.onnx", keep_pictures=False))
    again = OfflineScene.load(tmp_path / "bathroom_00000")
    assert again.perception != scene.perception
    assert (np.asarray(again.features) != features).any()


def test_pictures_of_a_camera_are_not_shown_to_a_network_for_another_unasked(tmp_path, capsys):
    for camera in ("stock_preview", "lite"):
        with pytest.raises(ValueError, match=f"found no --perception for the camera {camera}"):
            run(RoomOptions(["bathroom:0"], tmp_path, camera=camera, processes=1))
    run(RoomOptions(["bathroom:0"], tmp_path, camera="lite", views=1, processes=1))
    assert "another camera" not in capsys.readouterr().out


def test_another_perception_leaves_what_is_visible(tmp_path, perception):
    look = Look(CAMERAS["stock_preview"], perception)
    render_scene("bathroom", 0, tmp_path, look)
    first = OfflineScene.load(tmp_path / "bathroom_00000")
    features, visible = np.array(first.features), np.array(first.visible)
    visible[3] ^= True  # nobody sees this: it tells where the next one has it from
    replace(first, features=features, visible=visible).save(tmp_path / "bathroom_00000")
    torch.manual_seed(1)
    export_perception(PerceptionNet(), tmp_path / "other.onnx")
    render_scene("bathroom", 0, tmp_path, replace(look, perception=tmp_path / "other.onnx"))
    again = OfflineScene.load(tmp_path / "bathroom_00000")
    assert (np.asarray(again.features) != features).any()
    np.testing.assert_array_equal(again.visible, visible)
    # seen by another light, it is another room
    shifted_look = replace(look, visual_shift=1.0)
    render_scene("bathroom", 0, tmp_path, shifted_look)
    np.testing.assert_array_equal(
        OfflineScene.load(tmp_path / "bathroom_00000").visible[3], ~visible[3]
    )


def test_views_are_made_again_when_they_are_others_or_fewer(tmp_path, capsys):
    def make(**asked):
        run(RoomOptions(("kitchen:1000",), tmp_path, processes=1, **asked))
        return "(1 were there already)" in capsys.readouterr().out

    assert not make(views=2)
    assert make(views=2)
    assert make(views=1)
    assert not make(views=3)
    made = PictureSet.load(tmp_path / "kitchen_01000")
    replace(made, states=3).save(tmp_path / "kitchen_01000")
    assert make(views=4)  # there are no more
    for other in ({"camera": "lite"}, {"visual_shift": 0.5}):
        with pytest.raises(ValueError, match=r"found views of .* give another --out, or delete"):
            make(views=3, **other)
    for damaged in ("{", "[]"):
        (tmp_path / "kitchen_01000/set.json").write_text(damaged)
        assert not make(views=3)
        assert make(views=3)


def test_what_is_of_another_kind_is_never_written_over(tmp_path):
    def made():
        return sorted(path.name for path in (tmp_path / "bathroom_00033").iterdir())

    asked = RoomOptions(("bathroom:33",), tmp_path, processes=1)
    run(asked)
    scene = made()
    with pytest.raises(ValueError, match=r"found scenes of .* expected nothing or views of"):
        run(replace(asked, views=3))
    with pytest.raises(ValueError, match=r"found scenes of .* expected nothing or sightings of"):
        boxes.run(boxes.BoxOptions(tmp_path, ["bathroom:33"], camera="mast", processes=1))
    assert made() == scene
    run(replace(asked, out=tmp_path / "views", views=3))
    with pytest.raises(ValueError, match=r"found views of .* expected nothing or scenes of"):
        run(replace(asked, out=tmp_path / "views"))


def test_kept_pictures_serve_only_what_they_are_of(tmp_path):
    asked = RoomOptions(("bathroom:33",), tmp_path / "of", processes=1, keep_pictures=True)
    folder = tmp_path / "of" / "bathroom_00033"
    run(replace(asked, keep_pictures=False))
    assert not (folder / PICTURES).exists()
    run(asked)  # they are kept now
    right = np.load(folder / "features.npy")
    pictures = np.load(folder / PICTURES)
    # such as are of another light, or of views, say so or say nothing
    for note in ({"source": "another light"}, None):
        np.save(folder / PICTURES, pictures[::-1])
        note_of(folder / PICTURES).unlink(missing_ok=True)
        if note:
            note_of(folder / PICTURES).write_text(json.dumps(note))
        run(asked)
        np.testing.assert_array_equal(np.load(folder / "features.npy"), right)
        np.testing.assert_array_equal(np.load(folder / PICTURES), pictures)


def test_views_carry_consistent_labels(tmp_path):
    render_views("kitchen", 1000, tmp_path, Look(MAST, tmp_path), 20)
    views = PictureSet.load(tmp_path / "kitchen_01000")
    assert views.heat.shape == (20, 19, 19, len(CATEGORIES))
    shown, near = (pixels.astype(int).sum((1, 2)) for pixels in (views.heat, views.near))
    assert (near[views.visible] >= 40).all()
    assert (views.near <= views.heat).all()
    # one of two alike may be visible
    assert ((near > 0) & (near < shown)).any()
    assert 0.3 < views.depth.astype(float).mean() < 6


@pytest.mark.parametrize("size", [(96, 65), (97, 64), (97, 65)])
def test_pictures_of_an_odd_size_have_labels(size, tmp_path):
    high = 2 * np.degrees(np.arctan(np.tan(np.radians(30)) * size[1] / size[0]))
    camera = replace(CAMERAS["lite"], fov_deg=(60.0, float(high)), size=size)
    render_views("kitchen", 1000, tmp_path, Look(camera, tmp_path), 2)
    views = PictureSet.load(tmp_path / "kitchen_01000")
    assert views.heat.any()
    assert views.pictures.shape[1:3] == Sight.of(camera).picture == (32, 48)


FULL_DISK = """
import resource, sys
from pathlib import Path
import numpy as np
from sim_bridge.data.dataset import _keep
resource.setrlimit(resource.RLIMIT_FSIZE, (5000, resource.RLIM_INFINITY))
try:
    _keep(Path(sys.argv[1]), np.zeros(9000, np.uint8), "views")
except OSError as error:
    print(error)
"""


def test_a_full_disk_leaves_the_pictures_that_were_there(tmp_path):
    np.save(tmp_path / PICTURES, np.ones(3))
    # the kernel refuses to write files beyond 5000 bytes
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(tmp_path)],
        capture_output=True, text=True, check=True, timeout=300,
    )  # fmt: skip
    assert done.stdout.startswith(f"found no way to write {tmp_path}/pictures.npy (")
    assert done.stdout.endswith("); make room and run the same command again\n")
    assert [p.name for p in tmp_path.iterdir()] == [PICTURES]
    np.testing.assert_array_equal(np.load(tmp_path / PICTURES), np.ones(3))


ROOMS_MAKE = [sys.executable, "-m", "cfnav.cli", "rooms", "make"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--rooms", "attic:1"], "expected TYPE:SEED"),
        (["--rooms", "data3:test"], "data2:train, data2:validation, data2:test"),
        (["--visual-shift", "2"], "expected a number from 0 to 1"),
        (["--views", "2"], "found --views without --rooms"),
        (["--rooms", "kitchen:1", "--perception", "nowhere.onnx"], "no usable perception"),
    ],
)
def test_bad_input_is_one_sentence(tmp_path, arguments, sentence):
    command = [*ROOMS_MAKE, "--out", str(tmp_path), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert "Traceback" not in done.stderr


def test_no_gl_library_is_one_sentence(tmp_path, perception):
    command = [*ROOMS_MAKE, "--rooms", "kitchen:1",
               "--views", "1", "--out", str(tmp_path)]  # fmt: skip
    env = {k: v for k, v in os.environ.items() if k != "CFNAV_GL_CHOSEN"}
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env={**env, "MUJOCO_GL": "glfw"}
    )
    assert done.returncode == 2
    assert "apt-get install libosmesa6" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_camera_below_the_robots_top_needs_no_mast_and_drives_under_tables():
    assert [name for name, camera in CAMERAS.items() if camera.on_mast] == ["mast"]
    room = generate_room("living_room", 230)
    low, high = (state_grid(World(room, mast)) for mast in (False, True))
    assert len(low.positions) > len(high.positions)
