"""Models: frame, size, materials, pictures, what is left out, and the cache."""

import os
from dataclasses import replace

import cv2
import numpy as np
import pytest
from sim_bridge.sweet_home import cache, model
from sim_bridge.sweet_home.cache import load
from sim_bridge.sweet_home.catalogue import SweetHomeError, catalogue
from sim_bridge.sweet_home.model import TEXTURE_SIDE, build, picture

from tests.sim.sweet_home.conftest import BOARD, BOARD_MTL, board_files, png, quarters
from tests.sim.test_versions import Fingerprint


def built(furnish, entry=None, **files):
    furnish(entry or {}, files=board_files(**files))
    return build(catalogue()["Test#board"])


def test_front_is_at_positive_y_and_the_size_is_the_catalogues(furnish):
    board = built(furnish)
    front, rest = board.meshes
    assert front.vertices.dtype == np.float32
    assert front.faces.dtype == np.int32
    np.testing.assert_allclose(front.vertices[:, 1], 0.02)  # what faces the file's viewer
    corners = board.triangles.reshape(-1, 3)
    np.testing.assert_allclose(corners.min(0), (-0.2, -0.02, 0), atol=1e-7)
    np.testing.assert_allclose(corners.max(0), (0.2, 0.02, 0.2), atol=1e-7)
    # a viewer in front has the thing's right, +x, at his left
    left = front.vertices[front.uv[:, 0] == 0]
    np.testing.assert_allclose(left[:, 0], 0.2)
    # counter-clockwise from outside
    a, b, c = front.vertices[front.faces[0]]
    assert np.cross(b - a, c - a)[1] > 0
    assert len(rest.vertices) == 8


def test_coordinates_count_from_the_top_of_the_picture(furnish):
    front = built(furnish).meshes[0]
    top = front.vertices[:, 2] > 0.1
    np.testing.assert_array_equal(front.uv[top, 1], 0)
    np.testing.assert_array_equal(front.uv[~top, 1], 1)
    np.testing.assert_array_equal(front.texture, quarters())
    assert front.colour == (1, 1, 1, 1)  # not its Kd


def test_a_rotation_turns_before_the_stretch(furnish):
    # the file's y goes to its z: the board lies on its back, its front upwards... then deep
    entry = {"modelRotation": "1 0 0 0 0 1 0 -1 0", "depth": "20", "height": "4"}
    front = built(furnish, entry).meshes[0]
    np.testing.assert_allclose(front.vertices[:, 2], 0.04, atol=1e-7)
    np.testing.assert_allclose(sorted(set(front.vertices[:, 1].round(5))), (-0.1, 0.1), atol=1e-5)


def test_normals_stay_upright_on_what_is_stretched(furnish):
    obj = "v 0 0 0\nv 1 0 0\nv 0 1 1\nvn 0 1 -1\nf 3//1 2//1 1//1\n"
    slope = built(furnish, {"width": "100", "depth": "100", "height": "10"}, board_obj=obj)
    mesh = slope.meshes[0]
    a, b, c = mesh.vertices[mesh.faces[0]].astype(float)
    across = np.cross(b - a, c - a)
    np.testing.assert_allclose(
        np.abs(mesh.normals[0] @ across) / np.linalg.norm(across), 1, atol=1e-6
    )
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, rtol=1e-6)


def test_normals_of_no_length_are_left_to_whoever_draws(furnish):
    obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 0\nf 1//1 2//1 3//1\n"
    assert built(furnish, board_obj=obj).meshes[0].normals is None


def test_corners_are_shared_where_all_is_the_same(furnish):
    obj = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nvn 0 1 0\n"
    same = built(furnish, board_obj=f"{obj}f 1//1 2//1 3//1\nf 1//1 3//1 4//1\n").meshes[0]
    edge = built(furnish, board_obj=f"{obj}f 1//1 2//1 3//1\nf 1//2 3//2 4//2\n").meshes[0]
    assert (len(same.vertices), len(edge.vertices)) == (4, 6)


@pytest.mark.parametrize("wrong", [None, b"no picture", "none.png"])
def test_without_its_picture_a_mesh_has_its_colour(furnish, wrong):
    files = {"front_png": wrong} if isinstance(wrong, bytes) else {}
    named = "map_Kd " + (wrong if isinstance(wrong, str) else "C:/Desktop/wood 1.jpg")
    mtl = BOARD_MTL if files else BOARD_MTL.replace("map_Kd Front.png", named)
    front = built(furnish, board_mtl=mtl, **files).meshes[0]
    assert front.colour == (0.1, 0.1, 0.1, 1)
    assert front.texture is front.uv is None


def test_a_picture_without_coordinates_is_not_shown(furnish):
    front = built(furnish, board_obj=BOARD.replace("1/1 2/2", "1 2/2")).meshes[0]
    assert front.texture is None


def test_transparent_meshes_come_last_and_unseen_ones_not_at_all(furnish):
    glass = BOARD_MTL.replace("Kd 0.1 0.1 0.1\n", "d 0.5\n")
    board = built(furnish, board_mtl=glass)
    assert [mesh.transparent for mesh in board.meshes] == [False, True]
    assert board.meshes[1].colour == (1, 1, 1, 0.5)
    board = built(furnish, board_mtl=glass.replace("d 0.5", "d 0.01"))
    assert len(board.meshes) == 1
    assert board.meshes[0].colour == (0, 1, 0, 1)
    assert (board.meshes[0].specular, board.meshes[0].shininess) == (0.5, 0.5)


def test_a_material_that_nobody_describes_is_grey(furnish):
    board = built(furnish, board_obj=BOARD.replace("mtllib board.mtl", "mtllib gone.mtl"))
    assert {mesh.colour for mesh in board.meshes} == {(0.7, 0.7, 0.7, 1)}


def test_a_line_may_name_several_libraries(furnish):
    line = "mtllib gone.mtl board.mtl"
    board = built(furnish, board_obj=BOARD.replace("mtllib board.mtl", line))
    assert board.meshes[1].colour == (0, 1, 0, 1)


def test_triangles_of_no_area_are_left_out(furnish):
    flat = BOARD + "f 1 2 2\nf 1 1 1\n"
    assert len(built(furnish, board_obj=flat).triangles) == 12


def test_pictures_of_every_kind():
    rgb = np.zeros((300, 8, 3), np.uint8)
    rgb[::2] = 200
    small = picture(png(rgb))
    assert small.shape == (TEXTURE_SIDE, 8, 3)
    assert 60 < small.mean() < 140  # averaged, not picked
    clear = np.dstack([quarters(), np.full((8, 8), 255, np.uint8)])
    assert picture(png(clear)).shape == (8, 8, 3)
    clear[0, 0, 3] = 0
    np.testing.assert_array_equal(picture(png(clear)), clear)
    for grey in (np.full((4, 4), 90, np.uint8), np.full((4, 4), 90 * 256, np.uint16)):
        found = picture(cv2.imencode(".png", grey)[1].tobytes())
        assert (found == 90).all()
        assert found.shape == (4, 4, 3)
    assert picture(None) is picture(b"") is picture(b"GIF89a?") is None


@pytest.mark.parametrize(
    ("obj", "says"),
    [
        ("v 0 0 0\nf 1 1 9\n", "found corner '9'"),
        ("v 0 a 0\nf 1 1 1\n", "could not convert"),
        ("v 0 0 0\n", "found 0 triangles"),
        ("v 0 0 0\nv 1 1 1\nf 1 1 2\n", "found nothing to see"),
        ("v 0 0 nan\nv 1 1 1\nv 2 1 1\nf 1 2 3\n", "not a number"),
        (None, "there is no test/other.obj"),
    ],
)
def test_a_model_of_no_use_is_one_sentence(furnish, obj, says):
    entry = {} if obj else {"model": "/test/other.obj"}
    with pytest.raises(SweetHomeError) as error:
        built(furnish, entry, **({"board_obj": obj} if obj else {}))
    assert says in str(error.value)
    assert "Test#board" in str(error.value)
    assert str(error.value).endswith("leave this model out" if "damaged" in str(error.value)
                                     else "leave it out")  # fmt: skip


def test_a_model_that_is_too_large_is_left_out(furnish, monkeypatch):
    monkeypatch.setattr(model, "LARGEST", 11)
    with pytest.raises(SweetHomeError, match="found 12 triangles in Test#board, expected 1 to 11"):
        built(furnish)


def same(one, other):
    for a, b in zip(one.meshes, other.meshes, strict=True):
        for name in cache.ARRAYS:
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
        assert (a.colour, a.specular, a.shininess) == (b.colour, b.specular, b.shininess)
    assert replace(one, meshes=()) == replace(other, meshes=())


@pytest.fixture
def builds(monkeypatch):
    """Ids of the models that were read from archives."""
    made = []
    monkeypatch.setattr(
        cache, "build", lambda entry, apart=(): made.append(entry.id) or build(entry, apart)
    )
    return made


def test_the_second_time_a_model_comes_from_the_cache(furnish, builds):
    furnish()
    entry = catalogue()["Test#board"]
    same(load(entry), build(entry))
    same(load(entry), build(entry))
    assert builds == ["Test#board"]
    kept = list(cache.cache_folder().iterdir())
    assert [path.name.startswith("Test-board-") for path in kept] == [True]  # and nothing begun


def test_another_archive_or_entry_is_another_model(furnish, builds):
    folder = furnish()
    entry = catalogue()["Test#board"]
    load(entry)
    os.utime(folder / "BlendSwap-CC-0.sh3f", (1, 1))
    load(entry)
    assert load(replace(entry, size=(1.0, 1.0, 1.0))).size == (1, 1, 1)
    assert len(builds) == 3


@pytest.mark.parametrize("harm", ["cut", "changed", "empty", "text"])
def test_a_damaged_cache_is_made_anew(furnish, builds, harm):
    furnish()
    entry = catalogue()["Test#board"]
    load(entry)
    (path,) = cache.cache_folder().iterdir()
    whole = path.read_bytes()
    middle = len(whole) // 3
    path.write_bytes({
        "cut": whole[:middle], "empty": b"", "text": b"something else",
        "changed": whole[:middle] + bytes(255 - b for b in whole[middle : middle + 400])
        + whole[middle + 400 :],
    }[harm])  # fmt: skip
    same(load(entry), build(entry))
    same(load(entry), build(entry))
    assert len(builds) == 2


def test_without_a_place_for_the_cache_models_are_read_each_time(furnish, builds, monkeypatch):
    folder = furnish()
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "Scopia.sh3f"))  # a file
    entry = catalogue()["Test#board"]
    same(load(entry), load(entry))
    assert len(builds) == 2


def test_the_version_holds(furnish):
    """When this fails, either the change is a mistake or the version must rise with it."""
    made = Fingerprint(built(furnish, {"width": "140", "depth": "70", "height": "75"}))
    assert (cache.MODELS_VERSION, made.hash) == (3, "52a72bfc8725")
    assert made.sums == pytest.approx((25.250819, 280.47847), rel=1e-6)


def test_glass_that_no_file_describes_is_glass_all_the_same(furnish):
    board = built(furnish, board_obj=BOARD.replace("usemtl rest", "usemtl glasstransparent"))
    assert [mesh.colour[3] for mesh in board.meshes] == [1, 0.25]
    mtl = BOARD_MTL.replace("newmtl rest", "newmtl glasstransparent")
    obj = BOARD.replace("usemtl rest", "usemtl glasstransparent")
    board = built(furnish, board_obj=obj, board_mtl=mtl)
    assert board.meshes[1].colour == (0, 1, 0, 1)  # a file that describes it knows better


def test_named_objects_and_materials_are_meshes_of_their_own(furnish):
    folder = furnish(files=board_files(board_obj=TWO_THINGS))
    entry = catalogue(folder)["Test#board"]
    assert [mesh.name for mesh in build(entry).meshes] == ["", ""]
    apart = build(entry, {"cushion", "rest"})
    assert sorted(mesh.name for mesh in apart.meshes) == ["", "cushion", "rest"]
    sizes = {mesh.name: len(mesh.faces) for mesh in apart.meshes}
    assert sizes == {"": 2, "cushion": 2, "rest": 4}
    # the cache keeps names, and knows a model by what stays apart in it
    for names in ((), ("cushion",), ("cushion", "rest")):
        fresh = cache.load(entry, names)
        kept = cache.load(entry, names)
        assert [mesh.name for mesh in kept.meshes] == [mesh.name for mesh in fresh.meshes]
        assert {mesh.name for mesh in kept.meshes} == {"", *names}


TWO_THINGS = """mtllib board.mtl
v -1 0 0
v 1 0 0
v 1 1 0
v -1 1 0
v -1 0 1
v 1 0 1
v 1 1 1
v -1 1 1
o frame
usemtl front
f 1 2 3 4
usemtl rest
f 1 2 6 5
f 4 3 7 8
o cushion
usemtl front
f 5 6 7 8
"""
