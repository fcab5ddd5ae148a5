"""Frozen, empty and unsuitable pictures, without ROS."""

import math
import tracemalloc

import numpy as np
import pytest
from cfnav_ros.drive.inputs import CameraFrame, PictureCheck, Tilt
from cfnav_ros.drive.motion import Odometry
from cfnav_ros.drive.picture_watch import PictureWatch, emptiness, unsuitable

from cfnav_core.perception.perception import BUILT_IN

FINE = PictureCheck()
PERIOD_S = 1 / 15


def picture(seed, size=150):
    return np.random.default_rng(seed).integers(0, 256, (size, size, 3), np.uint8)


class Camera:
    """Shows pictures to a watch, with the robot's pose at each."""

    def __init__(self, frozen_time=1.0):
        self.watch = PictureWatch(BUILT_IN.check_size, frozen_time)
        self.t = 100.0
        self.pose, self.tilt, self.lag = [0.0, 0.0, 0.0], 0.0, 0.0

    def show(self, rgb, count=1):
        for _ in range(count):
            self.t += PERIOD_S
            frame = CameraFrame(
                round(self.t * 1e9),
                lambda every=1: rgb[::every, ::every],
                rgb.shape[0],
                rgb.shape[1],
                rgb.tobytes(),
            )
            odometry = Odometry(self.t + self.lag, *self.pose)
            answer = self.watch.look(frame, odometry, Tilt(self.t, self.tilt))
        return answer

    def show_noise(self, count):
        for seed in range(count):
            assert self.show(picture(seed)) == FINE


def test_pictures_that_differ_are_fine():
    Camera().show_noise(100)


def test_a_camera_with_noise_that_repeats_itself_is_frozen_after_its_time():
    camera = Camera()
    camera.show_noise(20)
    assert camera.show(picture(0), count=14) == FINE  # the first of them is new
    answer = camera.show(picture(0), count=2)
    assert answer.waiting.startswith("The camera is frozen: it has sent one picture for 1.0 s")
    assert camera.show(picture(1)) == FINE


def test_a_picture_that_is_delivered_twice_hides_no_noise():
    camera = Camera()
    for seed in range(20):
        assert camera.show(picture(seed)) == FINE
        camera.t -= PERIOD_S
        assert camera.show(picture(seed)) == FINE
    assert camera.show(picture(0), count=16).waiting.startswith("The camera is frozen")


def test_a_camera_without_noise_may_repeat_itself_while_the_robot_stands():
    camera = Camera()
    camera.pose[0] = 1.0
    assert camera.show(picture(0), count=200) == FINE
    assert camera.show(picture(1), count=200) == FINE  # put down elsewhere: odometry stays


@pytest.mark.parametrize("moved", ["x", "yaw", "tilt"])
def test_a_camera_without_noise_is_frozen_when_the_robot_moves(moved):
    camera = Camera()
    assert camera.show(picture(0), count=30) == FINE
    if moved == "tilt":
        camera.tilt = -math.radians(30)
    else:
        camera.pose[["x", "yaw"].index(moved) * 2] = 0.1
    assert camera.show(picture(0)).waiting.startswith("The camera is frozen")


def test_odometry_that_is_newer_than_the_picture_does_not_make_it_frozen():
    """A fast simulation on a slow machine: pictures wait longer for their turn than odometry."""
    camera = Camera()
    assert camera.show(picture(0), count=30) == FINE
    camera.pose[0], camera.lag = 0.1, 0.3
    assert camera.show(picture(0)) == FINE
    camera.lag = 0.05
    assert camera.show(picture(0)).waiting.startswith("The camera is frozen")


def test_pictures_that_differ_only_because_the_robot_moves_are_no_noise():
    camera = Camera()
    for seed in range(60):
        camera.pose[0] += 0.01
        camera.show(picture(seed))
    assert camera.show(picture(60), count=60) == FINE


def test_messages_that_say_nothing_are_no_noise():
    """A detector without noise may see nothing for long, and then one thing for long."""
    watch, t = PictureWatch(None, 1.0), 100.0
    for data in [None] * 30 + [("a mug",)] * 30:
        t += PERIOD_S
        frame = CameraFrame(round(t * 1e9), lambda every=1: (), 252, 448, data)
        assert watch.look(frame, Odometry(t, 0.0, 0.0, 0.0), Tilt(t, 0.0)) == FINE


def test_zero_never_calls_it_frozen():
    camera = Camera(frozen_time=0.0)
    camera.show_noise(20)
    camera.pose[0] = 1.0
    assert camera.show(picture(0), count=100) == FINE


@pytest.mark.parametrize("level", [0, 128, 255])
def test_an_empty_picture_is_told_even_through_noise(level):
    noise = np.random.default_rng(0).normal(level, 3.0, (300, 300, 3))
    for rgb in (np.full((300, 300, 3), level), noise.round().clip(0, 255)):
        sentence = emptiness(rgb.astype(np.uint8))
        assert sentence.startswith("The picture shows nothing")
        assert sentence.endswith("is the lens covered, is there light?")
    camera = Camera()
    blank = np.full((150, 150, 3), level, np.uint8)
    assert "shows nothing" in camera.show(blank, count=30).waiting


@pytest.mark.parametrize("size", [150, 250, 300, 1080])
def test_of_a_large_picture_only_so_much_is_looked_at(size):
    def decode(every):
        rows = len(range(0, size, every))
        assert rows < 200
        shown.append(rows)
        return np.full((rows, rows, 3), 128, np.uint8)

    shown = []
    frame = CameraFrame(1, decode, size, size, b"1")
    check = PictureWatch(BUILT_IN.check_size, 1.0).look(frame, Odometry(0, 0, 0, 0), Tilt())
    assert "shows nothing" in check.waiting
    assert min(shown) >= 100


@pytest.mark.parametrize("level", [3, 128])
def test_noise_of_a_large_picture_is_no_view(level):
    noise = np.random.default_rng(0).normal(level, 3.0, (1080, 1080, 3))
    camera = Camera()
    assert "shows nothing" in camera.show(noise.round().clip(0, 255).astype(np.uint8)).waiting


def test_a_dim_view_is_a_view():
    rgb = np.full((300, 300, 3), 20, np.uint8)
    rgb[:, :60] += 6
    assert emptiness(rgb) == ""


@pytest.mark.parametrize(
    ("height", "width", "word"), [(2160, 3840, "3840x2160"), (100, 100, "100x100"), (0, 0, "0x0")]
)
def test_a_size_that_the_policy_cannot_use_is_a_fault(height, width, word):
    assert word in unsuitable(BUILT_IN.check_size, height, width)
    assert "square" in unsuitable(BUILT_IN.check_size, height, width)
    frame = CameraFrame(1, lambda: pytest.fail("it need not be decoded"), height, width, b"")
    assert (
        word
        in PictureWatch(BUILT_IN.check_size, 1.0).look(frame, Odometry(0, 0, 0, 0), Tilt()).fault
    )


def test_the_size_of_an_enormous_picture_costs_nothing():
    """A header is only a promise: no memory is taken for it."""

    def short(_):
        raise ValueError("The picture holds 20 bytes.")

    tracemalloc.start()
    try:
        check = PictureWatch(BUILT_IN.check_size, 1.0).look(
            CameraFrame(1, short, 8000, 8000, b"1"), Odometry(0, 0, 0, 0), Tilt()
        )
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert check == PictureCheck(fault="The picture holds 20 bytes.")
    assert most < 1_000_000


def test_a_picture_that_cannot_be_decoded_is_a_fault():
    def bad(_):
        raise ValueError("The picture is encoded as yuv422.")

    frame = CameraFrame(1, bad, 150, 150, b"1")
    check = PictureWatch(BUILT_IN.check_size, 1.0).look(frame, Odometry(0, 0, 0, 0), Tilt())
    assert check == PictureCheck(fault="The picture is encoded as yuv422.")
