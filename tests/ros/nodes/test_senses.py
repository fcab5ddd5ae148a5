"""What the policy node hears, and what it asks the graph."""

import math
from array import array
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

pytestmark = pytest.mark.ros
rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_ros.drive.detection_watch import DetectionSettings  # noqa: E402
from cfnav_ros.drive.inputs import PictureCheck  # noqa: E402
from cfnav_ros.drive.limits import EpisodeLimits  # noqa: E402
from cfnav_ros.drive.policy_parameters import PolicyParameters  # noqa: E402
from cfnav_ros.drive.preflight import BaseCheck  # noqa: E402
from cfnav_ros.robot.stamps import NEVER  # noqa: E402
from cfnav_ros.ros.senses import Senses  # noqa: E402
from irobot_create_msgs.msg import (  # noqa: E402
    DockStatus,
    HazardDetection,
    HazardDetectionVector,
)
from nav_msgs.msg import Odometry  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from sensor_msgs.msg import CameraInfo, Image, JointState, LaserScan  # noqa: E402
from vision_msgs.msg import (  # noqa: E402
    BoundingBox2D,
    Detection2D,
    Detection2DArray,
    Detection3D,
    Detection3DArray,
    ObjectHypothesis,
    ObjectHypothesisWithPose,
)

from cfnav_core.perception.perception import BUILT_IN  # noqa: E402
from cfnav_core.robot.robot import SHIPPED as ROBOTS  # noqa: E402
from cfnav_core.robot.robot import Robot, load_robot  # noqa: E402
from cfnav_core.task.camera import CAMERAS, MAST  # noqa: E402
from tests.conftest import wait_until  # noqa: E402
from tests.ros.own_node import OwnNode  # noqa: E402

POLICY = SimpleNamespace(camera=MAST, check_size=BUILT_IN.check_size, reads_sightings=False)


@pytest.fixture
def node(ros_domain_id):
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain_id)
    node = rclpy.create_node("policy_node", context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


@pytest.mark.parametrize(("lidar", "tilt"), [(False, False), (True, False), (True, True)])
def test_the_graph_is_asked_for_what_is_needed_and_has_not_come(node, lidar, tilt):
    limits = EpisodeLimits(p_hat="lidar" if lidar else "own", veto=lidar, has_tilt=tilt)
    settings = PolicyParameters(episode=limits)
    senses = Senses(node, POLICY, settings, Robot(), lambda: None)
    senses.notice_base(BaseCheck())
    asked = {"frame", "odometry", *["estimate"] * lidar, *["tilt"] * tilt}
    assert set(senses.inputs.notes) == asked
    assert senses.inputs.notes["odometry"] == "nobody publishes /odom"


@pytest.mark.parametrize("lock_step", [False, True])
def test_in_lock_step_odometry_and_joints_wake_too(node, lock_step):
    woken = Counter()
    settings = PolicyParameters(lock_step=lock_step)
    senses = Senses(node, POLICY, settings, Robot(), lambda: woken.update(["wake"]))
    senses._on_odometry(Odometry())
    senses._on_joints(JointState(name=["camera_tilt"], position=[0.0]))
    assert woken["wake"] == 2 * lock_step
    assert senses.heard == {"odometry", "tilt"}


def test_what_the_robot_has_not_is_not_missed(node):
    base = load_robot("differential")
    senses = Senses(node, POLICY, PolicyParameters.of(base), base, lambda: None)
    assert senses.unheard == {}
    assert senses.topic("frame") == "/camera/image_raw"
    mast = Senses(node, POLICY, PolicyParameters(), Robot(), lambda: None)
    assert mast.unheard["hazards"] == "/hazard_detection"


def test_pictures_that_are_not_square_are_cut_by_their_camera_info(node):
    rgb = np.random.default_rng(0).integers(0, 256, (300, 400, 3), np.uint8)
    picture = Image(height=300, width=400, encoding="rgb8", step=1200)
    picture.data = array("B", rgb.tobytes())
    senses = Senses(node, POLICY, PolicyParameters(), Robot(), lambda: None)
    senses._on_view(picture)
    assert senses.inputs.stamps["frame"] == NEVER
    assert senses.inputs.notes["frame"].startswith("A picture of 400x300 waits for its camera_info")
    # The middle 300 of 400 columns are 90 degrees wide.
    k = [150.0, 0.0, 199.5, 0.0, 150.0, 149.5, 0.0, 0.0, 1.0]
    senses._on_camera(CameraInfo(height=300, width=400, k=k))
    senses._on_view(picture)
    assert senses.inputs.picture == PictureCheck()
    assert np.array_equal(senses.inputs.frame.decode(), rgb[:, 50:350])
    # The same bytes mean something else once another calibration comes.
    senses._on_camera(CameraInfo(height=300, width=400, k=[2 * f for f in k[:8]] + [1.0]))
    senses._on_view(picture)
    assert senses.inputs.picture.fault.startswith("The robot's camera shows a view of 67 x 53")


SIGHTED = SimpleNamespace(
    camera=None, check_size=None, reads_sightings=True, name="boxes", goals=("Mug",)
)
SOLD = load_robot("turtlebot4")


def said_of_a_cup(x, y, wide, high):
    box = BoundingBox2D(size_x=wide, size_y=high)
    box.center.position.x, box.center.position.y = x, y
    result = ObjectHypothesisWithPose(hypothesis=ObjectHypothesis(class_id="41", score=0.9))
    message = Detection2DArray(detections=[Detection2D(bbox=box, results=[result])])
    message.header.stamp.sec = 5
    return message


def calibrated(focal=345.0):
    k = [focal, 0.0, 223.5, 0.0, focal, 125.5, 0.0, 0.0, 1.0]
    return CameraInfo(height=252, width=448, k=k)


def sighted(node, **settings):
    detections = DetectionSettings(labels="coco", far_by="lidar", **settings)
    given = replace(PolicyParameters.of(SOLD), detections=detections)
    return Senses(node, SIGHTED, given, SOLD, lambda: None)


def test_a_detection_is_where_the_thing_stands(node):
    """A cup of 10 cm, 1.2 m before the robot's middle and 0.3 m to its right, at 0.4 m."""
    senses = sighted(node)
    camera_x, camera_z = CAMERAS["stock_wide"].x, CAMERAS["stock_wide"].z
    ahead = 1.2 - camera_x
    u, v = 224 + 345 * 0.3 / ahead, 126 - 345 * (0.4 - camera_z) / ahead
    scan = LaserScan(angle_min=-math.pi, angle_max=math.pi - math.tau / 720)
    scan.header.frame_id, scan.header.stamp.sec, scan.header.stamp.nanosec = (
        "rplidar_link",
        4,
        700000000,
    )
    scan.angle_increment, scan.range_min, scan.range_max = math.tau / 720, 0.15, 12.0
    # the laser sits 4 cm behind the middle, and it is turned by 90 degrees to the left
    turned = np.arange(720) * math.tau / 720 - math.pi - (math.atan2(-0.3, 1.24) - math.pi / 2)
    near = np.abs((turned + math.pi) % math.tau - math.pi) < 0.05
    scan.ranges = np.where(near, math.hypot(0.3, 1.24), 4.0).astype(np.float32).tolist()
    senses._on_camera(calibrated())
    senses._on_scan(scan)
    senses._on_view(said_of_a_cup(u, v, 345 * 0.1 / ahead, 345 * 0.1 / ahead))
    (mug,) = senses.inputs.frame.decode()
    assert mug.name == "Mug"
    assert mug.azimuth == pytest.approx(math.atan2(0.3, ahead), abs=0.01)
    assert mug.elevation == pytest.approx(
        math.atan2(0.4 - camera_z, math.hypot(ahead, 0.3)), abs=0.01
    )
    assert mug.distance == pytest.approx(math.hypot(1.2, 0.3), abs=0.05)


def test_what_is_told_with_its_place_is_as_far_as_that(node, other, tmp_path):
    """As depthai_ros_driver fills Detection3DArray: a box in pixels, and where the thing is."""
    path = tmp_path / "spatial.yaml"
    text = (ROBOTS / "turtlebot4.yaml").read_text()
    path.write_text(text.replace("topics:\n", "topics:\n  detections: nn/spatial_detections\n"))
    robot = load_robot(str(path))
    senses = Senses(node, SIGHTED, PolicyParameters.of(robot), robot, lambda: None)
    senses._on_camera(calibrated())
    result = ObjectHypothesisWithPose(hypothesis=ObjectHypothesis(class_id="41", score=0.9))
    result.pose.pose.position.z = 1.5
    one = Detection3D(results=[result])
    one.bbox.center.position.x, one.bbox.center.position.y = 224.0, 126.0
    one.bbox.size.x = one.bbox.size.y = 20.0
    message = Detection3DArray(detections=[one])
    message.header.stamp.sec = 5
    camera = other.create_publisher(Detection3DArray, "nn/spatial_detections", 10)

    def heard():
        camera.publish(message)
        return senses.inputs.frame.stamp_ns == 5 * 10**9

    spin_until(node, heard, "what the detector says")
    (mug,) = senses.inputs.frame.decode()
    assert (mug.name, mug.distance) == ("Mug", pytest.approx(1.5, abs=0.01))


def test_a_camera_that_cannot_tilt_may_be_said_to_look_down(node):
    senses = sighted(node, tilt_deg=-30.0)
    senses._on_camera(calibrated())
    senses._on_view(said_of_a_cup(224.0, 126.0, 20.0, 20.0))
    (mug,) = senses.inputs.frame.decode()
    assert mug.elevation == pytest.approx(math.radians(-30.0), abs=1e-6)


def test_a_camera_may_start_again_in_another_mode_between_drives_only(node):
    senses = sighted(node)
    senses._on_camera(calibrated())
    senses._on_view(said_of_a_cup(224.0, 126.0, 20.0, 20.0))
    senses.hold()
    senses._on_camera(calibrated(focal=400.0))
    senses._on_view(said_of_a_cup(224.0, 126.0, 21.0, 20.0))
    assert "speaks of another camera" in senses.inputs.picture.fault
    senses.release()
    senses._on_camera(calibrated(focal=400.0))
    senses._on_view(said_of_a_cup(224.0, 126.0, 22.0, 20.0))
    senses.restart()
    assert senses.inputs.picture == PictureCheck()
    assert len(senses.inputs.frame.decode()) == 1  # camera_info need not come again


@pytest.fixture
def other(ros_domain_id):
    """A node of another participant."""
    other = OwnNode(ros_domain_id, "other")
    yield other.node
    other.close()


def spin_until(node, condition, what):
    executor = rclpy.executors.SingleThreadedExecutor(context=node.context)
    executor.add_node(node)

    def spun():
        executor.spin_once(timeout_sec=0.01)
        return condition()

    wait_until(spun, what)
    executor.shutdown()


def say_once_and_leave(other, topic, message):
    publisher = other.create_publisher(type(message), topic, 10)
    wait_until(publisher.get_subscription_count, "the node to listen")
    publisher.publish(message)
    publisher.wait_for_all_acked()
    other.destroy_publisher(publisher)


def odometry(x):
    message = Odometry()
    message.pose.pose.position.x, message.pose.pose.orientation.w = x, 1.0
    message.header.stamp.sec = 1
    return message


@pytest.mark.parametrize("drives", [True, False])
def test_words_of_one_who_has_left_are_not_taken(node, other, drives):
    senses = Senses(node, POLICY, PolicyParameters(), Robot(), lambda: None)
    base = other.create_publisher(Odometry, "odom", 10)

    def hears(x):
        base.publish(odometry(x))
        return senses.inputs.odometry.x == x

    spin_until(node, lambda: hears(1.0), "the base's odometry")
    if drives:
        senses.restart()
        senses.hold()
        spin_until(node, lambda: hears(2.0), "odometry of the drive")
        assert senses.inputs.rival == ""
    before = senses.inputs.odometry
    say_once_and_leave(other, "odom", odometry(9.0))  # nobody has read it yet
    wait_until(lambda: node.count_publishers("odom") == 1, "the graph to forget the stranger")
    heard = Counter()
    spin_until(node, lambda: heard.update(["spun"]) or heard["spun"] > 20, "all to be read")
    assert senses.inputs.odometry == before
    assert senses.inputs.rival.startswith("Another publisher of /odom came and went: ")
    if drives:  # for as long as the drive lasts
        senses.look_for_rivals()
        spin_until(node, lambda: heard.update(["more"]) or heard["more"] > 20, "what comes")
        assert senses.inputs.rival != ""
        senses.release()
    senses.look_for_rivals()
    assert senses.inputs.rival == ""
    spin_until(node, lambda: hears(3.0), "the base alone")
    assert senses.inputs.rival == ""


def test_a_publisher_may_start_anew_until_the_robot_drives(node, other):
    senses = Senses(node, POLICY, PolicyParameters(), Robot(), lambda: None)

    def base_says(x):
        base = other.create_publisher(Odometry, "odom", 10)

        def hears():
            base.publish(odometry(x))
            senses.look_for_rivals()
            return senses.inputs.odometry.x == x

        spin_until(node, hears, "the base's odometry")
        return base

    senses.restart()
    other.destroy_publisher(base_says(1.0))
    senses.release()
    senses.restart()  # the next goal: nobody speaks, as the robot is on its dock
    base = base_says(2.0)
    assert senses.inputs.rival == ""
    senses.hold()
    other.destroy_publisher(base)
    again = other.create_publisher(Odometry, "odom", 10)
    wait_until(again.get_subscription_count, "the node to listen")
    wait_until(lambda: node.count_publishers("odom") == 1, "the first one to be forgotten")
    again.publish(odometry(3.0))
    spin_until(node, lambda: senses.inputs.rival, "the other one to be noticed")
    assert senses.inputs.odometry.x == 2.0


def test_another_name_does_not_drive_the_robot_at_the_next_goal(node, other, ros_domain_id):
    senses = Senses(node, POLICY, PolicyParameters(), Robot(), lambda: None)
    base = other.create_publisher(Odometry, "odom", 10)

    def hears(publisher, x):
        publisher.publish(odometry(x))
        senses.look_for_rivals()
        return senses.inputs.odometry.x == x

    spin_until(node, lambda: hears(base, 1.0), "the base's odometry")
    senses.restart()
    senses.hold()
    other.destroy_publisher(base)
    stranger = OwnNode(ros_domain_id, "stranger")
    try:
        false = stranger.node.create_publisher(Odometry, "odom", 10)
        senses.release()
        senses.restart()
        said = "stranger publishes /odom now, other did in the drive before: end it"
        spin_until(
            node,
            lambda: hears(false, 2.0) or senses.inputs.rival.startswith(said),
            "the stranger's word",
        )
        assert senses.inputs.odometry.x != 2.0
    finally:
        stranger.close()


def bump(*zones):
    kind = HazardDetection.BUMP
    return HazardDetectionVector(detections=[HazardDetection(type=kind) for _ in zones])


def test_one_who_has_left_cannot_free_the_bumper_but_press_it(node, other):
    senses = Senses(node, POLICY, PolicyParameters(), Robot(), lambda: None)
    base = other.create_publisher(HazardDetectionVector, "hazard_detection", 10)

    def heard():
        base.publish(bump())
        return "hazards" in senses.heard

    spin_until(node, heard, "the base's word")  # that it is listened to does not say by both sides
    base.publish(bump("front"))
    spin_until(node, lambda: senses.inputs.bumper, "the bump")
    senses.restart()
    senses.hold()
    say_once_and_leave(other, "hazard_detection", bump())
    wait_until(lambda: node.count_publishers("hazard_detection") == 1, "the stranger to be gone")
    spin_until(node, lambda: senses.inputs.rival, "the stranger's words to be read")
    assert senses.inputs.bumper
    senses.release()
    senses.look_for_rivals()
    assert senses.inputs.bumper
    assert "hazards" not in senses.heard
    wait_until(base.get_subscription_count, "the node to listen again")

    def freed():
        base.publish(bump())
        return not senses.inputs.bumper

    spin_until(node, freed, "the base's own word")


def test_a_latched_stranger_does_not_silence_a_base_that_is_not(node, other):
    senses = Senses(node, POLICY, PolicyParameters(), Robot(), lambda: None)
    base = other.create_publisher(DockStatus, "dock_status", 10)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    stranger = other.create_publisher(DockStatus, "dock_status", latched)
    wait_until(lambda: stranger.get_subscription_count() == 2, "both to be heard")

    def docked():
        base.publish(DockStatus(is_docked=True))
        return senses.inputs.docked

    spin_until(node, docked, "the base's word")
