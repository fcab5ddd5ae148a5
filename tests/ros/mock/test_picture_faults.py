"""Faults of pictures and depths: colours, encodings and sizes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: 'make setup'")

from cfnav_ros.robot.depths import depth_to_metres  # noqa: E402
from cfnav_ros.ros.conversions import frame_from_message, image_to_rgb  # noqa: E402
from rclpy.serialization import deserialize_message, serialize_message  # noqa: E402
from sim_bridge.faults import picture_faults  # noqa: E402
from sim_bridge.faults.faults import (  # noqa: E402
    DEPTH,
    DEPTH_INFO,
    IMAGE,
)
from sim_bridge.ros import conversions as to_msg  # noqa: E402

from tests.ros.mock.fault_messages import T0, first, suffered  # noqa: E402


@pytest.mark.parametrize("fault", picture_faults.SHAPES)
def test_a_compressed_picture_has_the_fault_of_the_raw_one(fault, monkeypatch):
    monkeypatch.setattr(picture_faults, "HUGE", (90, 160))
    colours = np.random.default_rng(0).integers(0, 255, (4, 4, 3), np.uint8)
    rgb = cv2.resize(colours, (60, 60))
    raw, message = to_msg.image(rgb, T0), to_msg.compressed_image(rgb, T0)
    for picture in (raw, message):
        picture_faults.SHAPES[fault](picture)
    frame = frame_from_message(deserialize_message(serialize_message(message), type(message)))
    if fault in ("image_16uc1", "image_step_short", "image_data_short", "image_empty"):
        with pytest.raises(ValueError, match="compressed picture"):
            frame.decode()
        assert bool(frame.fault) is (fault in ("image_step_short", "image_empty"))
    else:
        seen = frame.decode()
        assert seen.shape[:2] == (frame.height, frame.width) == (raw.height, raw.width)
        again = rgb if fault == "image_padded" else picture_faults.pixels_of(raw)[..., ::-1]
        assert np.abs(seen.astype(int) - again).mean() < 6


@pytest.mark.parametrize("encoding", ["rgb8", "bgra8", "mono8", "yuv422", "16uc1"])
def test_picture_of_every_encoding_can_be_read_again(encoding):
    image, original = first(f"image_{encoding}", IMAGE)
    seen, pixels = picture_faults.pixels_of(image), picture_faults.pixels_of(original)
    grey = picture_faults.grey(original)[..., None].repeat(3, 2)
    assert np.array_equal(seen, pixels if encoding in ("rgb8", "bgra8") else grey)


@pytest.mark.parametrize(("fault", "value"), [("image_black", 0), ("image_white", 255)])
def test_pictures_of_one_colour(fault, value):
    image, original = first(fault, IMAGE)
    assert set(image.data) == {value}
    assert (image.width, image.height, image.step) == (60, 60, original.step)


@pytest.mark.parametrize("fault", ["rgb8", "bgra8", "padded"])
def test_encodings_that_show_the_same_picture(fault):
    image, original = first(f"image_{fault}", IMAGE)
    assert np.array_equal(image_to_rgb(image), image_to_rgb(original))
    assert (image.encoding, image.step) != (original.encoding, original.step)
    assert len(image.data) == image.step * image.height


@pytest.mark.parametrize(
    ("fault", "encoding", "bytes_each"),
    [("mono8", "mono8", 1), ("yuv422", "yuv422", 2), ("16uc1", "16UC1", 2)],
)
def test_encodings_without_colour(fault, encoding, bytes_each):
    image, original = first(f"image_{fault}", IMAGE)
    assert (image.encoding, image.step) == (encoding, 60 * bytes_each)
    assert len(image.data) == 60 * 60 * bytes_each
    grey = image_to_rgb(original) @ np.array([0.299, 0.587, 0.114])
    if fault == "mono8":
        assert np.abs(image_to_rgb(image)[..., 0] - grey).max() <= 1


def test_pictures_that_contradict_themselves():
    image, original = first("image_step_short", IMAGE)
    assert image.step < 3 * image.width
    assert image.data == original.data
    image, _ = first("image_data_short", IMAGE)
    assert len(image.data) < image.step * image.height
    image, _ = first("image_empty", IMAGE)
    assert (image.width, image.height, len(image.data)) == (0, 0, 0)
    image, original = first("image_huge", IMAGE)
    assert (image.width, image.height, image.step) == (3840, 2160, 11520)
    assert len(image.data) == 11520 * 2160
    assert np.array_equal(image_to_rgb(image)[::36, ::64], image_to_rgb(original))


def test_depth_that_shows_nothing_is_not_there_or_stands_right_before_the_lens():
    empty, original = first("depth_all_zero", DEPTH)
    assert (empty.encoding, empty.step) == (original.encoding, original.step)
    assert not depth_to_metres(empty).any()
    near = [depth_to_metres(message) for message, _ in suffered("depth_all_near", DEPTH, 2)[0]]
    assert near[0].shape == (60, 80)
    assert np.abs(np.array(near) - picture_faults.NEAR_MM / 1000).max() < 0.02
    assert (near[0] != near[1]).any()  # or it would be frozen


def test_depth_that_cannot_be_read():
    colours, _ = first("depth_rgb8", DEPTH)
    assert (colours.step, len(colours.data)) == (3 * 80, 3 * 80 * 60)
    for fault, why in (("depth_rgb8", "encoded as 'rgb8'"), ("depth_data_short", "4800 bytes")):
        with pytest.raises(ValueError, match=why):
            depth_to_metres(first(fault, DEPTH)[0])
    calibration, original = first("depth_info_other", DEPTH_INFO)
    assert (2 * calibration.width, calibration.k[0]) == (original.width, original.k[0])
