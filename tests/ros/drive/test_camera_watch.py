"""What of a robot's pictures a policy's camera would show, and when none of them will do."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from cfnav_ros.drive.camera_watch import CHANGED, WHOLE, CameraWatch, fitting, other_camera
from cfnav_ros.drive.inputs import CameraFrame

from cfnav_core.task.camera import CAMERAS, MAST
from cfnav_core.task.pinhole import Pinhole


def camera(wide: float, width: int, height: int, cx: float = math.nan) -> Pinhole:
    """A camera with square pixels and a horizontal field of view, degrees."""
    focal = width / 2 / math.tan(math.radians(wide / 2))
    middle = (width - 1) / 2, (height - 1) / 2
    return Pinhole(focal, focal, cx if cx == cx else middle[0], middle[1], width, height)


def frame(height: int, width: int) -> CameraFrame:
    """A picture whose pixels say where they are: row, column, 0."""
    rows, columns = np.mgrid[:height, :width] % 256
    rgb = np.stack([rows, columns, 0 * rows], 2).astype(np.uint8)
    return CameraFrame(1, lambda every=1: rgb[::every, ::every], height, width, b"it")


def watch(found: Pinhole) -> CameraWatch:
    watch = CameraWatch(MAST, told=True)
    watch.tell(found)
    return watch


PREVIEW = camera(40.0, 250, 250)
FOUR_THIRDS = camera(2 * math.degrees(math.atan(4 / 3)), 400, 300)
"""Its middle is the mast's picture."""


def test_the_view_follows_from_focal_length_and_size() -> None:
    assert Pinhole(150.0, 150.0, 149.5, 149.5, 300, 300).fov_deg == pytest.approx((90.0, 90.0))
    assert PREVIEW.fov_deg == pytest.approx((40.0, 40.0), abs=0.1)


@pytest.mark.parametrize(
    ("focal", "cx"), [(0.0, 0.0), (-1.0, 0.0), (math.nan, 0.0), (100.0, math.nan)]
)
def test_a_camera_that_nobody_calibrated_says_nothing(focal: float, cx: float) -> None:
    found = Pinhole(focal, focal, cx, 0.0, 250, 250)
    assert found.fov_deg is None
    assert (fitting(MAST, found), other_camera(MAST, found)) == (WHOLE, "")


@pytest.mark.parametrize(
    "found",
    [PREVIEW, camera(66.0, 1280, 720), camera(71.6, 320, 240), camera(120.0, 1280, 720, cx=100.0)],
)
def test_a_view_that_is_too_narrow_is_refused_by_the_names_of_both(found: Pinhole) -> None:
    said = other_camera(MAST, found)
    assert f"degrees in {found.width} x {found.height} pixels" in said
    assert "90 x 90 degrees, 300 x 300 pixels, 1.3 m up, tilts to 0 and -30 degrees" in said
    assert "other_camera" in said
    seen = watch(found).see(frame(found.height, found.width))
    assert seen.fault == said


def test_the_same_camera_is_whole_in_any_resolution() -> None:
    for learnt, found in (
        (MAST, camera(90.0, 150, 150)),
        (MAST, camera(93.0, 151, 150)),
        (CAMERAS["stock_preview"], PREVIEW),
    ):
        assert fitting(learnt, found) is WHOLE
    picture = frame(150, 150)
    assert watch(camera(90.0, 150, 150)).see(picture) is picture


def test_the_middle_of_a_wider_picture_is_what_the_policy_sees() -> None:
    seen = watch(FOUR_THIRDS).see(frame(300, 400))
    rgb = seen.decode()
    assert (seen.height, seen.width, seen.data) == (300, 300, b"it")
    assert np.array_equal(rgb, frame(300, 400).decode()[:, 50:350])
    few = seen.decode(3)
    assert few.shape == (100, 100, 3)
    assert abs(int(few[0, 0, 1]) - 50) <= 3


def test_the_cut_is_around_the_camera_s_axis_and_scales_with_the_picture() -> None:
    off = camera(2 * math.degrees(math.atan(4 / 3)), 400, 300, cx=219.5)
    assert np.array_equal(
        watch(off).see(frame(300, 400)).decode(), frame(300, 400).decode()[:, 70:370]
    )
    twice = watch(FOUR_THIRDS).see(frame(600, 800))
    assert (twice.height, twice.width) == (600, 600)


def test_what_little_lacks_is_left_out_on_all_sides_and_the_shape_stays() -> None:
    found = camera(110.0, 1280, 850)
    assert 86.0 < found.fov_deg[1] < 90.0
    seen = watch(found).see(frame(850, 1280))
    assert (seen.height, seen.width) == (850, 850)
    low = camera(110.0, 1280, 760)
    assert fitting(MAST, low) is None


def test_before_camera_info_only_pictures_of_the_right_shape_are_taken() -> None:
    silent = CameraWatch(MAST, told=True)
    square = frame(150, 150)
    assert silent.see(square) is square
    with pytest.raises(ValueError, match=r"A picture of 400x300 waits for its camera_info"):
        silent.see(frame(300, 400))
    for careless in (CameraWatch(MAST, told=False), CameraWatch(None, told=True)):
        careless.tell(PREVIEW)
        wide = frame(300, 400)
        assert careless.see(wide) is wide


def test_another_camera_that_is_meant_is_whole_and_a_wider_one_is_cut_all_the_same() -> None:
    meant = CameraWatch(MAST, told=True, any_camera=True)
    meant.tell(PREVIEW)
    picture = frame(250, 250)
    assert meant.see(picture) is picture
    meant.tell(FOUR_THIRDS)
    assert meant.see(frame(300, 400)).width == 300


def test_a_camera_that_changes_in_a_drive_is_a_fault_until_the_next() -> None:
    watch = CameraWatch(MAST, told=True)
    picture = frame(300, 400)
    watch.tell(FOUR_THIRDS, driving=True)
    assert not watch.see(picture).fault  # the first word of it
    for found in (replace(FOUR_THIRDS, fx=0.0, fy=0.0), FOUR_THIRDS):
        watch.tell(found, driving=True)
        assert watch.see(picture).fault == CHANGED
    nobody = replace(FOUR_THIRDS, fx=math.nan, fy=math.nan)
    uncalibrated = CameraWatch(MAST, told=True)
    for _ in range(2):
        uncalibrated.tell(nobody, driving=True)
        assert not uncalibrated.see(picture).fault
    watch.tell(FOUR_THIRDS)  # between drives its driver may have been started again
    assert not watch.see(picture).fault


def test_a_camera_info_of_other_pictures_cuts_none() -> None:
    seen = watch(FOUR_THIRDS).see(frame(360, 640))
    assert seen.fault.startswith("The picture is 640x360, but its camera_info speaks of 400x300: ")


def test_what_is_known_to_be_no_picture_stays_so() -> None:
    broken = CameraFrame(1, fault="The compressed picture is broken.")
    assert watch(FOUR_THIRDS).see(broken) is broken
    assert CameraWatch(MAST, told=True).see(broken) is broken
