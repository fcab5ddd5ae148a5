"""Where the LiDAR sits: transforms composed by hand, and which source is believed."""

import math

import numpy as np
import pytest
from cfnav_ros.lidar.frames import FrameTree, planar_mount
from cfnav_ros.lidar.mounting import Mounting
from cfnav_ros.lidar.returns import Mount

STILL = (0.0, 0.0, 0.0, 1.0)
LEFT = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
TB4 = Mount(-0.04, 0.0, math.pi / 2)


def yaw(angle):
    return (0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2))


def same(mount, expected):
    assert (mount.x, mount.y) == pytest.approx((expected.x, expected.y), abs=1e-9)
    assert math.remainder(mount.yaw - expected.yaw, math.tau) == pytest.approx(0, abs=1e-9)
    assert mount.upside_down is expected.upside_down


def turtlebot4(tree):
    tree.add("odom", "base_link", (3.0, 2.0, 0.0), yaw(1.0))
    tree.add("base_link", "shell_link", (0.0, 0.0, 0.0942), STILL)
    tree.add("shell_link", "rplidar_link", (-0.04, 0.0, 0.0988), LEFT)


def test_the_turtlebots_own_chain():
    tree = FrameTree()
    turtlebot4(tree)
    pose = tree.pose("base_link", "rplidar_link")
    assert pose[2, 3] == pytest.approx(0.193)
    same(planar_mount(pose), TB4)


def test_a_turned_link_in_between_by_hand():
    tree = FrameTree()
    tree.add("base_link", "tower", (0.1, 0.0, 0.2), LEFT)  # the tower's x points left
    tree.add("tower", "laser", (0.05, -0.02, 0.0), yaw(math.pi))
    same(planar_mount(tree.pose("base_link", "laser")), Mount(0.12, 0.05, -math.pi / 2))


def test_frames_that_only_share_an_ancestor():
    tree = FrameTree()
    tree.add("base_footprint", "base_link", (0.0, 0.0, 0.1), yaw(math.pi / 2))
    tree.add("/base_footprint", "/laser", (0.0, 0.3, 0.2), STILL)
    same(planar_mount(tree.pose("base_link", "laser")), Mount(0.3, 0.0, -math.pi / 2))


def test_a_scanner_that_hangs_upside_down():
    tree = FrameTree()
    tree.add("base_link", "laser", (0.1, 0.0, 0.2), (1.0, 0.0, 0.0, 0.0))  # rolled by 180 degrees
    mount = planar_mount(tree.pose("base_link", "laser"))
    same(mount, Mount(0.1, 0.0, 0.0, upside_down=True))
    assert mount.bearings(np.array([0.5])) == pytest.approx([-0.5])  # its left is our right


def test_a_scanner_that_leans_is_refused():
    tree = FrameTree()
    half = math.radians(10)
    tree.add("base_link", "laser", (0.0, 0.0, 0.2), (0.0, math.sin(half), 0.0, math.cos(half)))
    with pytest.raises(ValueError, match="leans by 20 degrees, expected at most 5"):
        planar_mount(tree.pose("base_link", "laser"))


def test_what_is_no_transform_is_not_taken_and_loops_join_nothing():
    tree = FrameTree()
    assert not tree.add("base_link", "laser", (math.nan, 0.0, 0.0), STILL)
    assert not tree.add("base_link", "laser", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
    assert tree.pose("base_link", "laser") is None
    assert tree.add("a", "b", (0.0, 0.0, 0.0), STILL)
    assert tree.add("b", "a", (0.0, 0.0, 0.0), STILL)
    assert tree.pose("base_link", "a") is None


# Which source is believed


def mounting(source="auto", given=False, parameters=TB4):
    return Mounting(source, parameters, given, "base_link", "rplidar_link")


def test_auto_takes_tf_when_it_comes():
    chosen = mounting(parameters=Mount(0.0, 0.0, 0.0))
    assert chosen.choose("rplidar_link") == (Mount(0.0, 0.0, 0.0), "parameters", "")
    turtlebot4(chosen.tree)
    mount, source, fault = chosen.choose("rplidar_link")
    assert (source, fault) == ("TF", "")
    same(mount, TB4)


def test_tf_alone_waits_for_tf():
    chosen = mounting("tf")
    mount, _, fault = chosen.choose("rplidar_link")
    assert mount is None
    assert fault == "TF does not join base_link and rplidar_link yet."
    turtlebot4(chosen.tree)
    assert chosen.choose("rplidar_link")[1:] == ("TF", "")


@pytest.mark.parametrize(
    "parameters", [Mount(0.0, 0.0, math.pi / 2), Mount(-0.04, 0.0, 0.0), Mount(-0.04, 0.05, 1.57)]
)
def test_given_parameters_must_not_contradict_tf(parameters):
    chosen = mounting(given=True, parameters=parameters)
    assert chosen.choose("rplidar_link")[0] == parameters
    turtlebot4(chosen.tree)
    mount, _, fault = chosen.choose("rplidar_link")
    assert mount is None
    assert fault.startswith("TF puts the LiDAR at (-0.040, 0.000) m, yaw 90 degrees, the param")


def test_given_parameters_may_be_inaccurate_or_preferred():
    near = Mount(-0.03, 0.0, math.radians(91))
    chosen = mounting(given=True, parameters=near)
    turtlebot4(chosen.tree)
    assert chosen.choose("rplidar_link")[1:] == ("TF", "")
    far = Mount(0.2, 0.0, 0.0)
    chosen = mounting("parameters", True, far)
    turtlebot4(chosen.tree)
    assert chosen.choose("rplidar_link") == (far, "parameters", "")


@pytest.mark.parametrize("last", [TB4, Mount(-0.04, 0.0, 0.0)])
def test_what_tf_says_for_good_it_must_not_say_otherwise(last):
    chosen = mounting("tf")
    turtlebot4(chosen.tree)
    for mount in (TB4, TB4, Mount(-0.04, 0.0, 0.0), last):
        way = ("shell_link", "rplidar_link", (mount.x, mount.y, 0.0988), yaw(mount.yaw))
        chosen.tree.add(*way, fixed=True)
    mount, _, fault = chosen.choose("rplidar_link")
    assert mount is None
    assert fault == (
        "TF has two places for rplidar_link, one of them in tf_static: end the publisher that is "
        "wrong, then start the LiDAR node again."
    )


@pytest.mark.parametrize("source", ["auto", "tf"])
@pytest.mark.parametrize("parent", ["nowhere", "rplidar_link"])
@pytest.mark.parametrize("fixed", [True, False])
def test_who_takes_the_scanner_off_the_tree_does_not_bring_the_parameters_back(
    source, parent, fixed
):
    chosen = mounting(source, parameters=Mount(0.0, 0.0, 0.0))
    turtlebot4(chosen.tree)
    assert chosen.choose("rplidar_link")[1] == "TF"
    chosen.tree.add(parent, "rplidar_link", (0.0, 0.0, 0.0), STILL, fixed=fixed)
    mount, _, fault = chosen.choose("rplidar_link")
    assert mount is None
    assert fault.startswith("TF joined base_link and rplidar_link before and does not now")


def test_what_is_said_otherwise_of_frames_elsewhere_does_not_matter():
    chosen = mounting("tf")
    turtlebot4(chosen.tree)
    for x in (0.0, 1.0):
        chosen.tree.add("map", "odom", (x, 0.0, 0.0), STILL, fixed=True)
        chosen.tree.add("base_link", "camera", (x, 0.0, 0.0), STILL, fixed=True)
    assert chosen.choose("rplidar_link")[1:] == ("TF", "")


def test_tf_that_moves_the_lidar_is_believed_no_more():
    chosen = mounting()
    turtlebot4(chosen.tree)
    same(chosen.choose("rplidar_link")[0], TB4)
    chosen.tree.add("shell_link", "rplidar_link", (-0.04, 0.0, 0.0988), yaw(0.0))
    mount, _, fault = chosen.choose("rplidar_link")
    assert mount is None
    assert fault.startswith("TF put the LiDAR at (-0.040, 0.000) m, yaw 90 degrees before")
