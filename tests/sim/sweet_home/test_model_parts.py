"""Furniture models in MuJoCo, and the pages to look at them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from sim_bridge.data.model_sheet import ModelOptions, contact_sheet, draw
from sim_bridge.room.parts import Frame
from sim_bridge.sweet_home.bands import Box
from sim_bridge.sweet_home.catalogue import SweetHomeError, catalogue
from sim_bridge.sweet_home.model import Mesh, Model, build
from sim_bridge.world.model_parts import add_model
from sim_bridge.world.world import TOUCH_ONLY, VISIBLE_MESH

from cfnav_core.command import DONE, PARTLY
from tests.sim.sweet_home.conftest import board_files, png

import mujoco as mj  # isort: skip


@pytest.fixture
def board(furnish):
    furnish()
    return build(catalogue()["Test#board"])


def test_two_of_a_model_share_everything_but_their_place(board):
    spec = mj.MjSpec()
    boxes = (Box((0.1, 0, 0.05), (0.05, 0.02, 0.05)),)
    assert add_model(spec, board, Frame(1, 2, 0.5, np.pi / 2), boxes) == 3
    assert add_model(spec, board, Frame(0, 0)) == 2
    model = spec.compile()
    assert (model.nmesh, model.nmat, model.ntex, model.ngeom) == (2, 2, 1, 5)
    assert model.geom_group.tolist() == [*[VISIBLE_MESH] * 2, TOUCH_ONLY, *[VISIBLE_MESH] * 2]
    data = mj.MjData(model)
    mj.mj_kinematics(model, data)
    np.testing.assert_allclose(data.geom_xpos[2], (1, 2.1, 0.55), atol=1e-9)
    # a quarter turn brings the model's front to the room's -x
    front = data.geom_xpos[0]
    np.testing.assert_allclose(front, (1 - 0.02, 2, 0.6), atol=1e-6)
    touch = model.geom_contype | model.geom_conaffinity
    assert (touch > 0).tolist() == [False, False, True, False, False]


def test_the_front_shows_its_picture_upright(board):
    tile = cv2.resize(draw(board, 220), (440, 440)).astype(int)
    red, green, blue = np.moveaxis(tile, 2, 0)
    white = np.minimum.reduce((red, green, blue)) > 235
    is_red, is_blue = red > green + blue, blue > red + green
    is_green = green > red + blue
    assert min(is_red.sum(), is_blue.sum(), is_green.sum()) > 500
    middle = {name: np.argwhere(mask).mean(0) for name, mask in (
        ("red", is_red), ("blue", is_blue), ("green", is_green))}  # fmt: skip
    assert middle["red"][0] < middle["blue"][0] - 20  # above it
    assert middle["red"][1] < middle["green"][1] - 20  # left of it
    assert white.any()


@pytest.mark.parametrize("flat", [True, False])
def test_meshes_that_are_flat_or_of_one_triangle_are_drawn(flat):
    vertices = np.array([[-1, 0, 0], [1, 0, 0], [0, 0 if flat else 0.1, 1]], np.float32)
    faces = np.array([[0, 2, 1]], np.int32)
    mesh = Mesh("", vertices, faces, None, None, (1, 0, 0, 1), None, 0, 0)
    tile = draw(Model("one", (2, 0.1, 1), (mesh,), ()), 100).astype(int)
    assert (tile[..., 0] > tile[..., 1] + tile[..., 2]).sum() > 200


def test_what_is_cut_out_of_a_picture_shows_what_is_behind(furnish):
    clear = np.zeros((8, 8, 4), np.uint8)
    clear[..., 0] = 255
    clear[:4, :, 3] = 255
    furnish(files=board_files(front_png=png(clear)))
    tile = draw(build(catalogue()["Test#board"]), 220).astype(int)
    red = tile[..., 0] > tile[..., 1] + tile[..., 2]
    furnish(files=board_files(front_png=png(np.dstack([clear[..., :3], 0 * clear[..., 3] + 255]))))
    whole = draw(build(catalogue()["Test#board"]), 220).astype(int)
    all_red = whole[..., 0] > whole[..., 1] + whole[..., 2]
    assert 0.35 < red.sum() / all_red.sum() < 0.65


def test_pages_have_tiles_in_order(board):
    pages = list(contact_sheet([board] * 3, columns=2, rows=1, side=60))
    assert [page.shape for page in pages] == [(60, 120, 3)] * 2
    assert pages[0].dtype == np.uint8
    np.testing.assert_array_equal(pages[0][:, :60], pages[0][:, 60:])
    assert (pages[1][:, 60:] == 255).all()
    assert list(contact_sheet([])) == []


def test_the_command_draws_what_is_asked_for(furnish, tmp_path, capsys):
    furnish({}, {"id": "Test#lost", "name": "Lost", "model": "/test/lost.obj"})
    out = tmp_path / "out"
    assert ModelOptions(out, "BOARD").run_command() == DONE
    assert capsys.readouterr().out == f"1 models on 1 pages in {out}\n"
    assert cv2.imread(str(out / "page_001.png")).shape == (220, 1320, 3)
    assert ModelOptions(out).run_command() == PARTLY
    first, last = capsys.readouterr().out.splitlines()
    assert "there is no test/lost.obj" in first
    assert last.startswith("1 models on 1 pages")


def test_the_command_refuses_what_it_cannot_draw(furnish, tmp_path, monkeypatch):
    furnish()
    with pytest.raises(ValueError, match="found no model whose id, name or category has 'sofa'"):
        ModelOptions(tmp_path, "sofa").run_command()
    with pytest.raises(ValueError, match=r"found --only '\(', expected a regular expression"):
        ModelOptions(tmp_path, "(").run_command()
    monkeypatch.setenv("CFNAV_SWEET_HOME", str(tmp_path))
    with pytest.raises(SweetHomeError, match="apt install"):
        ModelOptions(tmp_path).run_command()
