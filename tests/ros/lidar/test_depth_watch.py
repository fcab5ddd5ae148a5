"""What depth adds to the LiDAR: nothing when in doubt, and never less than the LiDAR says."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from cfnav_ros.lidar.depth_memory import DepthParameters
from cfnav_ros.lidar.depth_watch import DepthWatch
from cfnav_ros.lidar.estimate import SweptDisc, estimate_collision
from cfnav_ros.lidar.frames import FrameTree
from cfnav_ros.lidar.sweep import NOMINAL
from cfnav_ros.robot.speakers import Speaker

from tests.ros.depth_scenes import (
    CAMERA,
    FRAME,
    MAST_DOWN,
    STOCK,
    cloud,
    depth_of,
    picture,
    quaternion,
    table,
)
from tests.ros.lidar_scans import room, scan_of

FREE = estimate_collision(scan_of(room))
PERIOD_S = 0.1
ONE = [Speaker(b"a", "oakd")]


class Robot:
    """A robot that drives along x among boxes and looks at them."""

    def __init__(self, boxes, pose=MAST_DOWN, **parameters):
        self.tree = FrameTree()
        self.boxes, self.now, self.x = boxes, 100.0, 0.0
        self.watch = DepthWatch(
            DepthParameters(**parameters), 1.0, SweptDisc(), NOMINAL, self.tree, "base_link"
        )
        self.watch.calibration(CAMERA)
        self.watch.publishers(ONE)
        self.aim(pose)
        self.watch.odometry(self.now, 0.0, 0.0, 0.0)
        self.rng = np.random.default_rng(0)

    def aim(self, pose):
        self.pose = pose
        self.tree.add("base_link", FRAME, tuple(pose[:3, 3]), quaternion(pose))

    def shown(self):
        """The depth picture from here, with the noise of a stereo camera."""
        boxes = [
            (np.subtract(low, (self.x, 0, 0)), np.subtract(high, (self.x, 0, 0)))
            for low, high in self.boxes
        ]
        depth = depth_of(boxes, self.pose)
        return depth + (depth > 0) * 0.006 * depth**2 * self.rng.standard_normal(depth.shape)

    def step(self, to=None, sends=True, message=None):
        """A picture's period passes; the estimate afterwards, where the LiDAR sees nothing."""
        if to is not None:
            self.x = to
        self.now += PERIOD_S
        if sends:
            self.watch.picture(self.now, message or picture(self.shown()))
        self.watch.odometry(self.now, self.x, 0.0, 0.0)
        return self.watch.joined(self.now, self.now, FREE)

    def stand(self, count=4, **how):
        for _ in range(count):
            estimate = self.step(**how)
        return estimate

    @property
    def fault(self):
        return self.watch.fault(self.now)


def test_the_poses_of_the_test_are_those_of_tf():
    robot = Robot([])
    for pose in (MAST_DOWN, STOCK):
        robot.aim(pose)
        assert robot.tree.pose("base_link", FRAME) == pytest.approx(pose, abs=1e-6)


@pytest.mark.parametrize(("way", "blocked"), [(0.20, True), (0.31, False)])
def test_a_table_top_is_in_the_mast_s_way_when_it_is_within_the_step(way, blocked):
    robot = Robot([table(0.8)])
    for x in np.linspace(0.0, 0.8 - 0.03 - way, 30):
        estimate = robot.step(to=x)
    assert robot.fault == ""
    assert estimate.clearance == pytest.approx(way - 0.01, abs=0.02)
    assert (estimate.probability > 0.5) is blocked
    assert FREE.probability <= estimate.probability


def test_a_cloud_says_what_its_picture_says():
    pictures, clouds = Robot([table(0.7)]), Robot([table(0.7)])
    for _ in range(3):
        seen = pictures.step()
        said = clouds.step(message=cloud(pictures.shown(), clouds.pose, "base_link"))
    assert said.clearance == pytest.approx(seen.clearance, abs=0.02)
    assert said.clearance < 0.7
    assert clouds.fault == ""
    clouds.step(message=cloud(clouds.shown(), clouds.pose, "elsewhere"))
    assert "TF does not join depth_optical_frame and elsewhere" in clouds.fault


def test_a_table_top_that_has_left_the_picture_is_still_in_the_way():
    robot = Robot([table(1.0)])
    for x in np.arange(0.0, 0.8, 0.02):
        estimate = robot.step(to=x)
    # 0.22 m before the mast: the camera sees nothing of a table nearer than 0.39 m
    x, _, height = CAMERA.placed(depth_of([table(0.22)], MAST_DOWN), MAST_DOWN)
    assert x[np.abs(height - 0.75) < 0.04].min() > 0.38
    assert estimate.probability > 0.95
    assert estimate.clearance == pytest.approx(0.22 - 0.03 - 0.01, abs=0.025)
    assert "Depth shows something 0.1" in estimate.reason
    assert "0.7" in estimate.reason
    assert estimate.verdict is FREE.verdict
    robot.boxes = []
    assert robot.stand(20, sends=False).probability > 0.95
    # what cannot be seen is forgotten in time
    assert robot.stand(300).probability == FREE.probability


def test_a_table_top_that_the_picture_cuts_off_may_begin_anywhere_nearer():
    robot = Robot([table(0.25)])  # its edge was never in view
    estimate = robot.stand()
    way = 1.3 - 0.75
    way = way / np.tan(np.radians(30.0 + np.degrees(np.arctan(49.5 / 110)))) - 0.03
    assert estimate.probability == pytest.approx(0.25 / way, abs=0.05)
    assert estimate.clearance == pytest.approx(way - 0.01, abs=0.02)
    wall = ((0.6, -2.0, 0.0), (0.8, 2.0, 1.2))  # goes on downwards
    assert Robot([wall]).stand().probability == FREE.probability


def test_what_the_body_passes_by_or_under_is_no_obstacle():
    beside = ((0.1, 0.24, 0.0), (1.5, 0.3, 1.2))
    over = ((0.3, -0.5, 1.4), (1.5, 0.5, 1.5))
    shelf_beside_the_mast = ((0.2, 0.06, 0.5), (0.9, 0.4, 0.53))
    robot = Robot([beside, over, shelf_beside_the_mast])
    for x in np.arange(0.0, 0.4, 0.02):
        estimate = robot.step(to=x)
    assert robot.fault == ""
    assert estimate.probability == FREE.probability


def test_the_hull_of_the_robot_as_it_is_sold_meets_an_open_drawer():
    drawer = ((0.8, -0.2, 0.22), (1.2, 0.2, 0.32))  # over the LiDAR's plane
    robot = Robot([drawer], STOCK, mast_height=0.0)
    for x in np.arange(0.0, 0.5, 0.02):
        estimate = robot.step(to=x)
    assert estimate.probability > 0.9
    seat = ((0.8, -0.2, 0.40), (1.2, 0.2, 0.45))  # over the hull
    robot = Robot([seat], STOCK, mast_height=0.0)
    for x in np.arange(0.0, 0.5, 0.02):
        estimate = robot.step(to=x)
    assert estimate.probability == FREE.probability


def test_what_a_picture_sees_through_is_forgotten_at_once():
    somebody = ((0.75, -0.2, 0.0), (0.95, 0.2, 1.6))
    robot = Robot([somebody])
    assert robot.stand(5).clearance < 0.6
    robot.boxes = []
    assert robot.stand(2).clearance == FREE.clearance


def test_depth_never_makes_the_lidar_less_careful():
    robot = Robot([])
    robot.stand()
    for p, clearance in ((0.3, 0.2), (1.0, 0.0)):
        said = dataclasses.replace(FREE, probability=p, clearance=clearance)
        assert robot.watch.joined(robot.now, robot.now, said) == said


def test_a_mismatch_in_one_picture_is_no_obstacle():
    robot = Robot([])
    robot.stand()
    ghost = depth_of([((0.45, -0.1, 0.6), (0.5, 0.1, 0.8))], MAST_DOWN)
    assert robot.step(message=picture(ghost)).probability == FREE.probability
    assert robot.step(message=picture(ghost)).clearance < FREE.clearance  # twice is something


def test_pictures_of_a_camera_that_turns_are_left_out():
    robot = Robot([table(0.7)])
    for _ in range(6):
        robot.aim(MAST_DOWN if robot.pose is STOCK else STOCK)
        assert robot.step().clearance == FREE.clearance
    assert robot.stand().clearance < FREE.clearance


def test_odometry_that_was_reset_forgets_and_one_that_repeats_does_not():
    robot = Robot([table(0.7)])
    assert robot.stand().clearance < FREE.clearance
    for late in (0.0, 0.15):
        robot.watch.odometry(robot.now - late, 3.0, 0.0, 0.0)
    assert robot.step(sends=False).clearance < FREE.clearance
    assert robot.step(to=5.0, sends=False).clearance == FREE.clearance


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda r: r.watch.publishers([*ONE, Speaker(b"b", "x")]), "2 nodes publish depth"),
        (lambda r: r.watch.publishers([Speaker(b"b", "x")]), "x publishes depth now, in place of"),
        (lambda r: r.watch.calibration(dataclasses.replace(CAMERA, width=640)), "says 640x100"),
        (lambda r: r.watch.calibration(dataclasses.replace(CAMERA, fy=-1.0)), "110 and -1"),
        (lambda r: r.watch.calibration(dataclasses.replace(CAMERA, cx=np.nan)), "calibrate it"),
        (lambda r: setattr(r.tree, "_up", {}), "TF does not join base_link and depth_optical"),
        (lambda r: setattr(r, "boxes", [((0.01, -5, 0), (0.02, 5, 9))]), ""),
        (lambda r: setattr(r, "now", r.now + 5.0), ""),
    ],
)
def test_doubt_is_one_sentence_and_changes_nothing(change, sentence):
    robot = Robot([])
    robot.stand()
    change(robot)
    estimate = robot.step()
    assert estimate.probability == FREE.probability
    assert sentence in robot.fault


def test_silence_lateness_blindness_and_a_picture_that_hangs_are_said():
    robot = Robot([table(0.7)])
    assert robot.fault == "No depth picture has arrived."
    before = robot.stand()
    robot.now += 1.2
    assert robot.fault == "The newest depth picture is 1.2 s old."
    assert robot.step(message=picture(np.zeros((100, 160)))).clearance == before.clearance
    assert "0% of the depth picture's pixels measure something" in robot.fault
    same = picture(robot.shown())
    robot.stand(12, message=same)
    assert "has not changed in 1.1 s" in robot.fault
    robot.stand()
    assert robot.fault == ""
    late = picture(robot.shown())
    robot.watch.picture(robot.now - 3.0, late)
    robot.step(sends=False)
    assert "is 3.1 s old" in robot.fault


def test_a_new_driver_in_place_of_the_old_is_believed_again():
    robot = Robot([])
    robot.stand()
    robot.watch.publishers([Speaker(b"b", "oakd")])
    assert robot.fault
    robot.watch.publishers([Speaker(b"b", "oakd")])
    robot.step()
    assert robot.fault == ""


def test_pictures_without_odometry_of_their_time_are_said():
    robot = Robot([])
    for k in range(3):
        robot.watch.picture(robot.now + 1.0 + k, picture(robot.shown()))
        robot.watch.joined(robot.now, robot.now, FREE)
    assert "No odometry is of the time of the depth pictures" in robot.fault


@pytest.mark.parametrize("size", [(1, 1), (40, 1), (1, 40), (4, 4)])
def test_a_picture_of_hardly_a_row_changes_nothing(size):
    width, height = size
    robot = Robot([table(0.3)])
    robot.watch.calibration(dataclasses.replace(CAMERA, width=width, height=height))
    for _ in range(3):
        estimate = robot.step(message=picture(np.ones((height, width), np.float32)))
    assert estimate.probability == FREE.probability
    assert robot.watch.fault(robot.now) == ""
