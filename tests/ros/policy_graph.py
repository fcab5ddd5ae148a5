"""A policy node as a process, and a small robot that repeats itself exactly and is its client."""

import math
import os
import subprocess
import sys
import time
from array import array
from contextlib import contextmanager

import numpy as np
import rclpy
from cfnav_interfaces.action import NavigateToObject
from cfnav_interfaces.msg import (
    CollisionEstimate,
    EpisodeStatus,
    Moment,
    MomentDone,
    PolicyDecision,
)
from cfnav_ros.drive.fields import stamp_to_ns
from cfnav_ros.ros.conversions import ns_to_stamp
from cfnav_ros.ros.spinning import SpinningThread, leave
from geometry_msgs.msg import TwistStamped
from irobot_create_msgs.msg import DockStatus, HazardDetection, HazardDetectionVector, WheelStatus
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import Float64

from tests.conftest import DEADLINE_S, wait_until

PERIOD_S = 0.05
LATE_M, LATE_DEG = 0.1, 30.0
"""How far the robot gets in half a second, by which a machine under load may let it be late;
how exact motions are is tested without processes."""
PATIENT = (
    "episode.ages.frame:=4.0",
    "episode.ages.estimate:=2.0",
    "episode.ages.odometry:=1.0",
    "episode.ages.tilt:=2.0",
    "episode.preflight_timeout:=40.0",
    "episode.observe_timeout:=20.0",
    "episode.motion.move_deadline:=20.0",
    "episode.motion.turn_deadline:=16.0",
    "episode.motion.stall_time:=4.0",
    "episode.command_lag:=2.0",
)
"""Four times the node's patience by default: a machine under load may let messages lie for longer
than that, which is no fault of what is tested here."""
BEST_EFFORT = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
"""A real base keeps the newest velocity only; here none may be lost on a busy machine."""

LOST = "client will not receive response"
"""What a node says when a client asks before discovery has shown it where that client listens
(ros2/rmw_fastrtps issue 842); the answer is lost, and only then may a test ask again."""


class Robot:
    """A base, a camera and an estimate at 20 Hz in a thread, and a client; exact and unhurried."""

    def __init__(
        self, domain, name="mock_turtlebot4", velocity=TwistStamped, clock=False, namespace="",
        lock_step=False,
    ):  # fmt: skip
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = Node(name, context=self.context, namespace=namespace)
        self.clock = 100_000_000_000 if clock else None
        self.x = self.y = self.yaw = self.tilt = self.v = self.w = 0.0
        self.probability, self.clearance = 0.1, 2.0
        self.bumping, self.bump_told = False, None
        self.encoding, self.silent, self.count = "bgr8", set(), 0
        self.focal = 0.0  # pixels; 0 says nothing of the camera
        self.lock_step, self.free, self.newest = lock_step, True, {}
        self.answered = self.heard = None  # the newest moment with an answer, idle ones in heard
        self.damage, self.skew = {}, 0.0  # functions on messages; seconds that stamps are behind
        self.commands, self.pictures, self.feedback, self.frames = [], {}, [], set()
        self.decisions, self.statuses = [], []
        self._make_topics(velocity)
        self.client = ActionClient(self.node, NavigateToObject, "navigate_to_object")
        self.thread = SpinningThread(self.node)
        self.thread.start()

    def _make_topics(self, velocity):
        node = self.node
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        told = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.publishers = {
            "clock": node.create_publisher(Clock, "/clock", 10),
            "odometry": node.create_publisher(Odometry, "odom", latched),
            "joints": node.create_publisher(JointState, "joint_states", 10),
            "image": node.create_publisher(Image, "oakd/rgb/preview/image_raw", 10),
            "camera": node.create_publisher(CameraInfo, "oakd/rgb/preview/camera_info", 10),
            "estimate": node.create_publisher(CollisionEstimate, "collision/estimate", 5),
            "hazard": node.create_publisher(HazardDetectionVector, "hazard_detection", told),
            "dock": node.create_publisher(DockStatus, "dock_status", latched),
            "wheels": node.create_publisher(WheelStatus, "wheel_status", latched),
        }
        if velocity is not None:
            self.subscription = node.create_subscription(
                velocity, "cmd_vel", self._on_velocity, BEST_EFFORT
            )
        node.create_subscription(Float64, "camera_tilt/command", self._on_tilt, 10)
        node.create_subscription(PolicyDecision, "policy/decision", self.decisions.append, 50)
        node.create_subscription(EpisodeStatus, "policy/episode", self.statuses.append, told)
        if self.lock_step:
            told = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            self.publishers["moment"] = node.create_publisher(Moment, "simulator/moment", told)
            node.create_subscription(MomentDone, "simulator/moment_done", self._on_done, told)
            self.go_on = node.create_guard_condition(self._go_on)
        node.create_timer(0.002 if self.lock_step else PERIOD_S, self._step)

    def _on_velocity(self, message):
        twist, sent = message, time.time()
        if isinstance(message, TwistStamped):
            twist, sent = message.twist, stamp_to_ns(message.header.stamp) * 1e-9
            self.frames.add(message.header.frame_id)
        self.v, self.w = twist.linear.x, twist.angular.z
        self.commands.append((sent, self.v, self.w))

    def _on_tilt(self, message):
        self.tilt = message.data

    def _on_done(self, done):
        self.heard = stamp_to_ns(done.stamp)
        if not done.idle:
            self.answered = self.heard
            # Triggered, not called: the velocity that was sent before it is taken in first.
            self.go_on.trigger()

    def _go_on(self):
        self.free |= self.answered == self.clock

    def put_back(self):
        """Begin anew, as at the start, with a new moment that the node has heard of.

        A goal sent before that would begin at the moment before.
        """
        before = self.clock
        self.x = self.y = self.yaw = self.tilt = self.v = self.w = 0.0
        self.count, self.newest = 0, {}
        self.commands.clear()
        self.decisions.clear()
        self.free = True
        self.wait(lambda: before != self.clock == self.heard, "the new moment to be heard of")

    def stamp(self):
        now = self.node.get_clock().now().nanoseconds if self.clock is None else self.clock
        return ns_to_stamp(now - round(self.skew * 1e9))

    def _send(self, name, message):
        if name not in self.silent:
            self.damage.get(name, lambda message: None)(message)
            self.publishers[name].publish(message)

    def say(self, **status):
        """Publish a status of the base once: docked or powered."""
        if "docked" in status:
            self.publishers["dock"].publish(DockStatus(is_docked=status["docked"]))
        if "powered" in status:
            self.publishers["wheels"].publish(WheelStatus(wheels_enabled=status["powered"]))

    def _step(self):
        if not self.free:
            return
        self.free = not self.lock_step
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
        self.newest["odometry"] = stamp
        joints = JointState(name=["camera_tilt"], position=[self.tilt])
        joints.header.stamp = stamp
        self._send("joints", joints)
        if self.count % 2 == 0:
            if self.focal:
                k = [self.focal, 0.0, 75.0, 0.0, self.focal, 75.0, 0.0, 0.0, 1.0]
                self._send("camera", CameraInfo(height=150, width=150, k=k))
            self._send("image", self._picture(stamp))
            self.newest["image"] = stamp
        if self.count % 3 == 0:
            estimate = CollisionEstimate(probability=self.probability, clearance=self.clearance)
            estimate.header.stamp = stamp
            self._send("estimate", estimate)
            self.newest["scan"] = stamp
        if self.bumping is not self.bump_told:  # as firmware H.2.5 and later does
            self.bump_told = self.bumping
            hazards = HazardDetectionVector()
            hazards.header.stamp = stamp
            if self.bumping:
                hazards.detections = [HazardDetection(type=HazardDetection.BUMP)]
            self._send("hazard", hazards)
        if self.lock_step:
            self._send("moment", Moment(stamp=stamp, **self.newest))

    def _picture(self, stamp):
        rng = np.random.default_rng(self.count)
        pixels = np.repeat(rng.integers(0, 256, (15, 15, 3), np.uint8), 10, 0).repeat(10, 1)
        message = Image(height=150, width=150, encoding=self.encoding, step=450, is_bigendian=1)
        message.header.stamp, message.data = stamp, array("B", pixels.tobytes())
        self.pictures[stamp_to_ns(stamp)] = message
        return message

    # The client's side

    def wait(self, condition, what):
        wait_until(condition, what)

    def send(self, goal="Laptop", **fields):
        """Send a goal, return its handle and the future of its result."""
        self.wait(self.client.server_is_ready, "the action server")
        sent = self._sent(goal, fields)
        self.wait(lambda: sent.done() or LOST in self.log.read_text(), "the goal to be accepted")
        if not sent.done():
            sent = self._sent(goal, fields)
            self.wait(sent.done, "the goal to be accepted")
        assert sent.result().accepted
        return sent.result(), self.done(sent.result().get_result_async)

    def _sent(self, goal, fields):
        return self.done(lambda: self.client.send_goal_async(
            NavigateToObject.Goal(goal=goal, **fields),
            feedback_callback=lambda message: self.feedback.append(message.feedback),
        ))  # fmt: skip

    def done(self, call):
        """What a function returns in the thread that takes the answers."""
        task = self.thread.executor.create_task(call)
        self.wait(task.done, "the robot's thread")
        return task.result()

    def result(self, future):
        self.wait(future.done, "the result")
        return future.result().status, future.result().result

    def wait_driving(self):
        self.wait(lambda: self.v > 0.1, "the robot to drive")

    def wait_zeros(self, lasting, count=3):
        """Wait until so many zero velocities have come at the end, sent for so long, s."""

        def stopped():
            moving = max(k for k, (_, v, w) in enumerate(self.commands) if v or w)
            sent = [t for t, _, _ in self.commands[moving + 1 :]]
            return len(sent) >= count and sent[-1] - sent[0] >= lasting

        self.wait(stopped, f"{count} zeros in {lasting} s")

    def close(self):
        self.thread.end()
        leave(self.node)


def start_node(domain, log, *parameters, program=("-m", "cfnav_ros.ros.policy_node"), remap=""):
    command = [sys.executable, *program, "--ros-args", *(["-r", remap] if remap else [])]
    for parameter in parameters:
        command += ["-p", parameter]
    env = {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_PYTHON_CHECK_FIELDS": "1"}
    with log.open("w") as output:
        return subprocess.Popen(command, env=env, stdout=output, stderr=output)


@contextmanager
def policy_graph(folder, domain):
    """Starts a robot and a policy node; afterwards the node must have been well or be ended."""
    started = []

    def start(bundle, *parameters, program=("-m", "cfnav_ros.ros.policy_node"), remap="", **robot):
        log = folder / "log"
        robot = Robot(domain, **robot)
        robot.log = log
        started.append(robot)
        process = start_node(
            domain, log, f"bundle:={bundle}", *PATIENT, *parameters, program=program, remap=remap
        )
        started.append(process)
        return robot, process, log

    try:
        yield start
    finally:
        for thing in reversed(started):
            if isinstance(thing, Robot):
                thing.close()
            elif thing.poll() is None:
                end(thing)


def end(process):
    """Ends a node so that the graph hears of it: a killed one haunts its domain, and /dev/shm."""
    process.terminate()
    try:
        process.wait(DEADLINE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def end_with(process, number):
    process.send_signal(number)
    return process.wait(DEADLINE_S)


def standing(robot):
    return robot.v == 0 and robot.w == 0
