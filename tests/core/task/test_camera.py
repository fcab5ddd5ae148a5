"""The camera set-up: what it refuses, what it says, and when two cameras are one."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from cfnav_core.task.camera import CAMERAS, MAST, CameraSetUp

WIDE = CameraSetUp(0.1, 0.3, (80.0, 50.5), (640, 360), (0.1, -0.2, -0.6))


@pytest.mark.parametrize("camera", [*CAMERAS.values(), WIDE])
def test_a_set_up_survives_its_file(camera: CameraSetUp, tmp_path: Path) -> None:
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(camera.to_json()))
    found = CameraSetUp.read(str(path))
    assert found.horizons == pytest.approx(camera.horizons)
    assert replace(found, horizons=camera.horizons) == camera


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"z": 0.0}, "z over 0"),
        ({"fov_deg": (90.0, 180.0)}, "1 to 179 degrees"),
        ({"size": (300, 0)}, "width and height"),
        ({"horizons": ()}, "each below the last"),
        ({"horizons": (-0.5, 0.0)}, "each below the last"),
    ],
)
def test_what_makes_no_sense_is_refused(change: dict, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        replace(MAST, **change)


@pytest.mark.parametrize(
    ("text", "words"),
    [("{", "usable camera"), ('{"x": 1}', "with or without"), ("[]", "usable camera")],
)
def test_a_file_that_is_no_camera_is_refused(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "camera.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=words):
        CameraSetUp.read(str(path))
    with pytest.raises(ValueError, match=r"mast, stock_preview, stock_wide, lite or a JSON file"):
        CameraSetUp.read(str(tmp_path / "none"))


def test_a_view_that_the_picture_contradicts_is_refused() -> None:
    """A maker's 95 x 70 degrees are of another mode of the sensor than its 1280 x 720 pixels."""
    with pytest.raises(ValueError, match=r"70 degrees down come with 102\.4 across"):
        CameraSetUp(0.0, 0.3, (95.0, 70.0), (1280, 720), (0.0,))
    assert CameraSetUp(0.0, 0.3, (95.0, 63.1), (1280, 720), (0.0,))


def test_focal_lengths_follow_from_the_view() -> None:
    assert MAST.focal_share == pytest.approx((0.5, 0.5))
    x, y = WIDE.focal_share
    assert 640 * x == pytest.approx(320 / math.tan(math.radians(40)))
    assert 360 * y == pytest.approx(180 / math.tan(math.radians(25.25)))


def test_cameras_differ_by_view_and_shape_and_not_by_pixels() -> None:
    assert MAST.differs((89.0, 91.5), (600, 600)) == ""
    assert "40 x 40 degrees in 250 x 250" in MAST.differs((40.0, 40.0), (250, 250))
    assert MAST.differs((90.0, 90.0), (640, 360)) != ""


def test_cameras_see_alike_from_one_place_in_however_many_pixels() -> None:
    assert MAST.sees_like(replace(MAST, size=(448, 448)))
    assert not MAST.sees_like(replace(MAST, z=1.0))
    assert not MAST.sees_like(replace(MAST, horizons=(0.0,)))
    assert not MAST.sees_like(CAMERAS["stock_preview"])
    assert not CAMERAS["stock_wide"].sees_like(CAMERAS["lite"])


def test_it_says_itself_in_words() -> None:
    assert str(MAST) == "90 x 90 degrees, 300 x 300 pixels, 1.3 m up, tilts to 0 and -30 degrees"
    assert "does not tilt" in str(CAMERAS["stock_preview"])
