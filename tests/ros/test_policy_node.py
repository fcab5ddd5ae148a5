"""The policy node as a process, with real bundles, on a small robot that repeats itself exactly."""

import math
import os
import signal
import subprocess
import sys
import threading
import time
from array import array

import numpy as np
import pytest

from cfnav_core.actions import HORIZONS_RAD, NUM_ACTIONS, Action

pytestmark = pytest.mark.ros
rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from action_msgs.msg import GoalStatus  # noqa: E402
from cfnav_interfaces.action import NavigateToObject  # noqa: E402
from cfnav_interfaces.msg import CollisionEstimate, EpisodeStatus, PolicyDecision  # noqa: E402
from cfnav_ros.conversions import image_to_rgb, ns_to_stamp, stamp_to_ns  # noqa: E402
from geometry_msgs.msg import Twist, TwistStamped  # noqa: E402
from irobot_create_msgs.msg import HazardDetection, HazardDetectionVector  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from rcl_interfaces.srv import GetParameters  # noqa: E402
from rclpy.action import ActionClient  # noqa: E402
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from sensor_msgs.msg import Image, JointState  # noqa: E402
from std_msgs.msg import Float64  # noqa: E402

from cfnav_core.bundle import NETWORKS, BundleHead, file_hash  # noqa: E402
from cfnav_core.policy import Policy  # noqa: E402

DEADLINE_S = 60.0
PERIOD_S = 0.05
LATE_M, LATE_DEG = 0.05, 15.0
"""How far the robot gets on odometry as old as the node allows (0.25 s), on a machine under load;
how exact motions are is tested without processes."""
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
ROUND = ("RotateLeft", "MoveAhead", "LookDown", "LookUp", "RotateRight", "Done")


@pytest.fixture(scope="module")
def make_bundle(tmp_path_factory):
    """Bundles of real networks that answer a list of actions, then repeat the last."""
    import torch
    from torch import nn

    from cfnav_core.collision_predictor import CollisionPredictor
    from cfnav_core.export import export_networks
    from cfnav_core.perception import FEATURES
    from cfnav_core.perception_net import PerceptionNet, export_perception

    class Sequence(nn.Module):
        """Logits from a table of previous actions, with a small share of what is seen."""

        hidden = 8

        def __init__(self, names):
            super().__init__()
            actions = [int(Action[name]) for name in names]
            table = torch.zeros(NUM_ACTIONS + 1, NUM_ACTIONS)
            for before, after in zip([NUM_ACTIONS, *actions], [*actions, actions[-1]], strict=True):
                table[before, after] = 6.0
            self.register_buffer("table", table)
            self.seen = nn.Linear(FEATURES, NUM_ACTIONS)

        def forward(self, features, detections, goal, previous, probability, h, c):
            first = 1 - previous.sum(1, keepdim=True)
            logits = torch.cat([previous, first], 1) @ self.table
            logits = logits + 0.1 * torch.tanh(self.seen(features)) + 0.1 * probability
            rest = 0 * (detections.sum() + goal.sum())
            return logits + rest, logits[:, :1], h + 0, c + 0

    folder = tmp_path_factory.mktemp("bundles")
    torch.manual_seed(0)
    perception = PerceptionNet()

    def make(*names):
        out = folder / "-".join(names)
        if not out.exists():
            out.mkdir()
            export_perception(perception, out / "perception.onnx")
            predictor = CollisionPredictor()
            export_networks(Sequence(names), predictor, out)
            hashes = {name: file_hash(out / name) for name in NETWORKS}
            BundleHead(
                out.name, "ours", True, ("Laptop", "Mug"), (8, predictor.hidden), hashes, {}, {}
            ).save(out)
        return out

    return make


class Robot:
    """A base, a camera and an estimate at 20 Hz in a thread, and a client; exact and unhurried."""

    def __init__(self, domain, name="mock_turtlebot4", velocity=TwistStamped, clock=False):
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = Node(name, context=self.context)
        self.clock = 100_000_000_000 if clock else None
        self.x = self.y = self.yaw = self.tilt = self.v = self.w = 0.0
        self.probability, self.clearance, self.bumping = 0.1, 2.0, False
        self.encoding, self.silent, self.count = "bgr8", set(), 0
        self.commands, self.pictures, self.feedback = [], {}, []
        self.decisions, self.statuses = [], []
        self._make_topics(velocity)
        self.client = ActionClient(self.node, NavigateToObject, "navigate_to_object")
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.thread = threading.Thread(target=self._spin)
        self.thread.start()

    def _spin(self):
        try:
            self.executor.spin()
        except ExternalShutdownException:
            return

    def _make_topics(self, velocity):
        node = self.node
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.publishers = {
            "clock": node.create_publisher(Clock, "/clock", 10),
            "odometry": node.create_publisher(Odometry, "odom", latched),
            "joints": node.create_publisher(JointState, "joint_states", 10),
            "image": node.create_publisher(Image, "oakd/rgb/preview/image_raw", 10),
            "estimate": node.create_publisher(CollisionEstimate, "collision/estimate", 5),
            "hazard": node.create_publisher(HazardDetectionVector, "hazard_detection", 5),
        }
        if velocity is not None:
            self.subscription = node.create_subscription(
                velocity, "cmd_vel", self._on_velocity, BEST_EFFORT
            )
        node.create_subscription(Float64, "camera_tilt/command", self._on_tilt, 10)
        node.create_subscription(PolicyDecision, "policy/decision", self.decisions.append, 50)
        node.create_subscription(EpisodeStatus, "policy/episode", self.statuses.append, 10)
        node.create_timer(PERIOD_S, self._step)

    def _on_velocity(self, message):
        twist = message.twist if isinstance(message, TwistStamped) else message
        self.v, self.w = twist.linear.x, twist.angular.z
        self.commands.append((time.monotonic(), self.v, self.w))

    def _on_tilt(self, message):
        self.tilt = message.data

    def stamp(self):
        if self.clock is None:
            return self.node.get_clock().now().to_msg()
        return ns_to_stamp(self.clock)

    def _send(self, name, message):
        if name not in self.silent:
            self.publishers[name].publish(message)

    def _step(self):
        self.count += 1
        if self.clock is not None and "clock" not in self.silent:
            self.clock += round(PERIOD_S * 1e9)
            self._send("clock", Clock(clock=self.stamp()))
        self.x += self.v * math.cos(self.yaw) * PERIOD_S
        self.y += self.v * math.sin(self.yaw) * PERIOD_S
        self.yaw += self.w * PERIOD_S
        stamp = self.stamp()
        odometry = Odometry()
        odometry.header.stamp = stamp
        odometry.pose.pose.position.x, odometry.pose.pose.position.y = self.x, self.y
        odometry.pose.pose.orientation.z = math.sin(self.yaw / 2)
        odometry.pose.pose.orientation.w = math.cos(self.yaw / 2)
        odometry.twist.twist.linear.x, odometry.twist.twist.angular.z = self.v, self.w
        self._send("odometry", odometry)
        joints = JointState(name=["camera_tilt"], position=[self.tilt])
        joints.header.stamp = stamp
        self._send("joints", joints)
        if self.count % 2 == 0:
            self._send("image", self._picture(stamp))
        if self.count % 3 == 0:
            estimate = CollisionEstimate(probability=self.probability, clearance=self.clearance)
            estimate.header.stamp = stamp
            self._send("estimate", estimate)
        hazards = HazardDetectionVector()
        hazards.header.stamp = stamp
        if self.bumping:
            hazards.detections = [HazardDetection(type=HazardDetection.BUMP)]
        self._send("hazard", hazards)

    def _picture(self, stamp):
        rng = np.random.default_rng(self.count)
        pixels = np.repeat(rng.integers(0, 256, (15, 15, 3), np.uint8), 10, 0).repeat(10, 1)
        message = Image(height=150, width=150, encoding=self.encoding, step=450, is_bigendian=1)
        message.header.stamp, message.data = stamp, array("B", pixels.tobytes())
        self.pictures[stamp_to_ns(stamp)] = message
        return message

    # The client's side

    def wait(self, condition, what):
        end = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < end, f"waited in vain: {what}"
            time.sleep(0.01)  # between looks at the condition; the messages come in a thread

    def send(self, goal="Laptop", **fields):
        """Send a goal, return its handle and the future of its result."""
        self.wait(self.client.server_is_ready, "the action server")
        sent = self.client.send_goal_async(
            NavigateToObject.Goal(goal=goal, **fields),
            feedback_callback=lambda message: self.feedback.append(message.feedback),
        )
        self.wait(sent.done, "the goal to be accepted")
        assert sent.result().accepted
        return sent.result(), sent.result().get_result_async()

    def result(self, future):
        self.wait(future.done, "the result")
        return future.result().status, future.result().result

    def wait_driving(self):
        self.wait(lambda: self.v > 0.1, "the robot to drive")

    def close(self):
        self.executor.shutdown()
        self.thread.join()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


FAILING = """
import sys
from cfnav_ros.episode import Episode
from cfnav_ros.policy_node import main
update = Episode.update
def fail_while_driving(self, t, inputs):
    if self.track.path_length > 0.05:
        raise RuntimeError("broken")
    return update(self, t, inputs)
Episode.update = fail_while_driving
sys.exit(main())
"""


def start_node(domain, log, *parameters, program=("-m", "cfnav_ros.policy_node")):
    command = [sys.executable, *program, "--ros-args"]
    for parameter in parameters:
        command += ["-p", parameter]
    env = {
        **os.environ,
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_PYTHON_CHECK_FIELDS": "1",
    }
    with log.open("w") as output:
        return subprocess.Popen(command, env=env, stdout=output, stderr=output)


@pytest.fixture
def graph(tmp_path, ros_domain_id):
    """Starts a robot and a policy node; afterwards the node must have been well or be ended."""
    started = []

    def start(bundle, *parameters, program=("-m", "cfnav_ros.policy_node"), **robot):
        log = tmp_path / "log"
        robot = Robot(ros_domain_id, **robot)
        started.append(robot)
        process = start_node(ros_domain_id, log, f"bundle:={bundle}", *parameters, program=program)
        started.append(process)
        return robot, process, log

    yield start
    for thing in reversed(started):
        if isinstance(thing, Robot):
            thing.close()
        elif thing.poll() is None:
            thing.kill()
            thing.wait()


def end_with(process, number):
    process.send_signal(number)
    return process.wait(DEADLINE_S)


def standing(robot):
    return robot.v == 0 and robot.w == 0


def test_an_episode_from_goal_to_done(graph, make_bundle):
    robot, process, log = graph(make_bundle(*ROUND))
    status, result = robot.result(robot.send()[1])
    assert (status, result.outcome) == (GoalStatus.STATUS_SUCCEEDED, "done"), result.message
    assert (result.steps, result.vetoes, result.bumps) == (6, 0, 0)
    assert result.path_length == pytest.approx(0.25, abs=LATE_M)
    assert math.hypot(robot.x, robot.y) == pytest.approx(0.25, abs=LATE_M)
    assert math.degrees(robot.yaw) == pytest.approx(0.0, abs=LATE_DEG)
    assert robot.tilt == HORIZONS_RAD[0]
    assert standing(robot)

    robot.wait(lambda: len(robot.statuses) == 2 and len(robot.decisions) == 6, "the reports")
    assert [Action(d.action).name for d in robot.decisions] == list(ROUND)
    assert [f.action for f in robot.feedback] == list(ROUND)
    assert [d.step for d in robot.decisions] == [1, 2, 3, 4, 5, 6]
    assert all(d.collision_probability == pytest.approx(0.1) for d in robot.decisions)
    begun, ended = robot.statuses
    assert (begun.phase, begun.goal, begun.outcome) == (EpisodeStatus.STARTED, "Laptop", "")
    assert (ended.phase, ended.outcome, ended.steps) == (EpisodeStatus.ENDED, "done", 6)
    assert ended.bundle == "-".join(ROUND)

    # The same policy on the same pictures gives the same answers as the node did.
    policy = Policy.load(make_bundle(*ROUND))
    policy.reset("Laptop")
    for decision in robot.decisions:
        picture = image_to_rgb(robot.pictures[stamp_to_ns(decision.image_stamp)])
        again = policy.act(picture, decision.collision_probability)
        assert int(again.action) == decision.action
        assert decision.action_probabilities == pytest.approx(again.probabilities, abs=1e-6)
        assert decision.detection_score == pytest.approx(again.detection_score, abs=1e-6)

    asked = robot.node.create_client(GetParameters, "policy_node/get_parameters")
    robot.wait(asked.service_is_ready, "the parameter service")
    answer = asked.call_async(GetParameters.Request(names=["episode.motion.v_max"]))
    robot.wait(answer.done, "a parameter")
    assert answer.result().values[0].double_value == 0.2

    text = log.read_text()
    assert f"Bundle {'-'.join(ROUND)} drives" in text
    assert "Goals: Laptop, Mug." in text
    assert "Sending TwistStamped to /cmd_vel." in text
    assert end_with(process, signal.SIGINT) == 0
    assert "Traceback" not in log.read_text()


def test_limits_vetoes_bumps_and_refusals(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"), "episode.max_steps:=2")
    _, result = robot.result(robot.send()[1])
    assert (result.outcome, result.steps) == ("step_limit", 2)
    assert robot.x == pytest.approx(0.5, abs=2 * LATE_M)
    status, result = robot.result(robot.send(max_steps=1)[1])
    assert (status, result.steps) == (GoalStatus.STATUS_ABORTED, 1)

    robot.probability, robot.clearance = 0.9, 0.1
    x = robot.x
    _, result = robot.result(robot.send(max_steps=4)[1])
    assert (result.outcome, result.steps, result.vetoes) == ("step_limit", 4, 4)
    assert robot.x == x
    assert all(d.vetoed for d in robot.decisions[-4:])
    robot.probability, robot.clearance = 0.1, 2.0

    future = robot.send(max_steps=1)[1]
    robot.wait_driving()
    robot.bumping = True
    _, result = robot.result(future)
    robot.bumping = False
    assert (result.outcome, result.bumps) == ("step_limit", 1)

    _, result = robot.result(robot.send("Unicorn")[1])
    assert result.outcome == "refused"
    assert result.message == "The bundle knows no goal 'Unicorn'; it knows Laptop, Mug."
    robot.encoding = "yuv422"
    seen = len(robot.pictures)
    robot.wait(lambda: len(robot.pictures) > seen + 3, "pictures of the other encoding")
    _, result = robot.result(robot.send()[1])
    assert result.outcome == "refused"
    assert "encoded as 'yuv422', expected one of rgb8" in result.message


def test_cancel_preempt_and_time_limit(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"))
    handle, future = robot.send()
    robot.wait_driving()
    handle.cancel_goal_async()
    status, result = robot.result(future)
    assert (status, result.outcome) == (GoalStatus.STATUS_CANCELED, "canceled")
    assert standing(robot)

    first = robot.send("Laptop")[1]
    robot.wait_driving()
    second = robot.send("Mug", time_limit=3.0)[1]
    third = robot.send("Laptop", time_limit=3.0)[1]
    for future in (first, second):
        status, result = robot.result(future)
        assert (status, result.outcome) == (GoalStatus.STATUS_ABORTED, "preempted")
    status, result = robot.result(third)
    assert (result.outcome, result.message) == ("time_limit", "3 s have passed.")
    assert standing(robot)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_the_robot_first(graph, make_bundle, number):
    robot, process, log = graph(make_bundle("MoveAhead"))
    future = robot.send()[1]
    robot.wait_driving()
    told = time.monotonic()
    assert end_with(process, number) == 0
    robot.wait(lambda: standing(robot), "the robot to stand")
    after = [(t, v, w) for t, v, w in robot.commands if t > told + 0.15]
    assert len(after) >= 5
    assert all(v == 0 and w == 0 for _, v, w in after)
    assert after[-1][0] - after[0][0] >= 0.3
    _, result = robot.result(future)
    assert (result.outcome, result.message) == ("aborted", "The policy node was stopped.")
    assert "Traceback" not in log.read_text()


def test_a_failing_callback_stops_the_robot_first(graph, make_bundle):
    robot, process, log = graph(make_bundle("MoveAhead"), program=("-c", FAILING))
    robot.send()
    assert process.wait(DEADLINE_S) == 1
    robot.wait(lambda: standing(robot), "the robot to stand")
    assert robot.x > 0.04
    zeros = [t for t, v, w in robot.commands if v == 0 and w == 0 and t > robot.commands[-20][0]]
    assert zeros[-1] - zeros[0] >= 0.3
    assert "RuntimeError: broken" in log.read_text()


def test_lost_odometry_stops_the_robot_and_then_the_episode(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"))
    future = robot.send()[1]
    robot.wait_driving()
    robot.silent = {"odometry"}
    lost = time.monotonic()
    robot.wait(lambda: standing(robot), "the robot to stand")
    assert time.monotonic() - lost < 1.0
    _, result = robot.result(future)
    assert result.outcome == "aborted"
    assert result.message.startswith("The newest odometry is ")


def test_a_clock_that_stops_stops_the_robot(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"), "use_sim_time:=true", clock=True)
    future = robot.send()[1]
    robot.wait_driving()
    robot.silent = {"clock"}
    stopped = time.monotonic()
    robot.wait(lambda: standing(robot), "the robot to stand")
    assert time.monotonic() - stopped < 1.5
    _, result = robot.result(future)
    assert (result.outcome, result.message) == (
        "aborted",
        "Node time stands still: is /clock published?",
    )
    robot.silent = set()
    _, result = robot.result(robot.send(max_steps=1)[1])
    assert result.outcome == "step_limit"


def test_twist_is_sent_to_who_listens_to_twist(graph, make_bundle):
    robot, _, log = graph(make_bundle("RotateLeft"), velocity=Twist)
    _, result = robot.result(robot.send(max_steps=1)[1])
    assert result.outcome == "step_limit"
    assert math.degrees(robot.yaw) == pytest.approx(45, abs=LATE_DEG)
    assert "Sending Twist to /cmd_vel." in log.read_text()


def test_a_real_robot_is_not_driven_without_leave(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"), name="create3_repub")
    status, result = robot.result(robot.send()[1])
    assert (status, result.outcome) == (GoalStatus.STATUS_ABORTED, "refused")
    assert result.message.startswith("create3_repub listens on /cmd_vel and may be a real robot")
    assert robot.commands == []


def test_a_second_publisher_is_a_refusal_and_a_missing_robot_too(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"), "episode.preflight_timeout:=3.0", velocity=None)
    _, result = robot.result(robot.send()[1])
    assert (result.outcome, result.message) == ("refused", "No robot listens on /cmd_vel.")
    rival = robot.node.create_publisher(TwistStamped, "cmd_vel", 1)
    _, result = robot.result(robot.send()[1])
    assert result.outcome == "refused"
    assert result.message.startswith("mock_turtlebot4 also publishes on /cmd_vel")
    robot.node.destroy_publisher(rival)


@pytest.mark.parametrize(
    ("parameter", "sentence"),
    [
        ("bundle:=/nowhere", "found no readable bundle in /nowhere"),
        ("cmd_vel_type:=both", "cmd_vel_type is 'both', expected auto, stamped or unstamped."),
        ("episode.motion.v_max:=0.01", "v_min is 0.05, expected a number in (0, v_max = 0.01]."),
    ],
)
def test_what_cannot_start_says_so_and_exits_with_2(tmp_path, ros_domain_id, parameter, sentence):
    process = start_node(ros_domain_id, tmp_path / "log", parameter)
    assert process.wait(DEADLINE_S) == 2
    lines = (tmp_path / "log").read_text().strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith(f"policy_node: {sentence}")


def test_a_damaged_bundle_says_so_and_exits_with_2(tmp_path, ros_domain_id, make_bundle):
    bundle = make_bundle("Done", "Done")
    with (bundle / "policy.onnx").open("ab") as file:
        file.write(b"x")
    process = start_node(ros_domain_id, tmp_path / "log", f"bundle:={bundle}")
    assert process.wait(DEADLINE_S) == 2
    assert "the bundle is damaged" in (tmp_path / "log").read_text().splitlines()[-1]
