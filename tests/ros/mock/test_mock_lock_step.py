"""A mock in lock-step with a scripted policy: it waits, and an episode repeats itself."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: 'make setup'")

from cfnav_interfaces.msg import Moment, MomentDone  # noqa: E402
from cfnav_interfaces.srv import StartEpisode  # noqa: E402
from cfnav_ros.process.domains import Domain  # noqa: E402
from geometry_msgs.msg import Twist, TwistStamped  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from sim_bridge.room.room import generate_room, parse_room  # noqa: E402
from sim_bridge.world.world import World  # noqa: E402
from std_msgs.msg import Float64  # noqa: E402

from tests.ros.mock_listener import ROOM, Listener, seconds, start_mock  # noqa: E402

IMAGE = "oakd/rgb/preview/image_raw"


class ScriptedPolicy:
    """Answers each moment: idle until told to drive, then with the commands of a list."""

    def __init__(self, listener):
        self.listener = listener
        node = listener.node
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.moments, self.commands, self.answered = [], [], 0
        node.create_subscription(Moment, "simulator/moment", self._hear, latched)
        self.done = node.create_publisher(MomentDone, "simulator/moment_done", 10)
        self.velocity = node.create_publisher(TwistStamped, "cmd_vel", 1)
        listener.wait(
            lambda: self.done.get_subscription_count() and self.velocity.get_subscription_count(),
            "the mock to listen",
        )

    def _hear(self, moment):
        self.moments.append(moment)
        if not self.commands:
            self.done.publish(MomentDone(stamp=moment.stamp, idle=True))

    def take_up(self, commands):
        """Drive by a list of (v, w, tilt), one a moment, beginning with the moment that waits."""
        self.commands = list(commands)
        self.answered = len(self.moments) - 1
        count = self.answered + len(commands)
        self.listener.wait(lambda: self.answered >= count, "the commands", self._answer)

    def hears(self, moment):
        """Whether all that a moment announces has come."""
        sensors = {IMAGE: moment.image, "scan": moment.scan, "odom": moment.odometry}
        return all(self.listener.last(t).header.stamp == stamp for t, stamp in sensors.items())

    def _answer(self):
        if not self.commands or self.answered >= len(self.moments):
            return
        moment = self.moments[self.answered]
        if not self.hears(moment):
            return
        v, w, tilt = self.commands.pop(0)
        twist = Twist()
        twist.linear.x, twist.angular.z = v, w
        self.velocity.publish(TwistStamped(twist=twist))
        self.listener.tilt.publish(Float64(data=tilt))
        self.answered += 1
        self.done.publish(MomentDone(stamp=moment.stamp, idle=False))


@pytest.fixture(scope="module")
def policy(tmp_path_factory):
    with Domain() as domain:
        log = tmp_path_factory.mktemp("mock") / "log"
        process = start_mock(log, domain, f"room:={ROOM}", "lock_step:=true", "speed:=0.0")
        listener = Listener(domain)
        try:
            process.wait_for_line("ready")
            listener.wait_connected(commands=False)
            policy = ScriptedPolicy(listener)
            listener.wait(lambda: policy.moments, "a moment")
            yield policy
            assert process.interrupt() == 0, process.output
            assert "Traceback" not in process.output
        finally:
            listener.close()
            process.end()


def drive(policy, seed, start):
    """An episode's drive: everything that was heard of it, stamps relative to its first moment."""
    robot = policy.listener
    answer = robot.call(StartEpisode, room=ROOM, goal="", seed=seed, start=start)
    assert answer.ok, answer.message
    first = len(policy.moments) - 1
    began = seconds(policy.moments[first].stamp)
    commands = [(0.2, 0.0, 0.0)] * 30 + [(0.0, 0.8, -0.3)] * 20 + [(0.15, -0.2, 0.0)] * 20
    policy.take_up(commands)
    robot.wait(lambda: len(policy.moments) > first + len(commands), "the last moment")
    last = seconds(policy.moments[-1].stamp)
    robot.wait(lambda: policy.hears(policy.moments[-1]), "the sensors of the last moment")
    robot.wait(lambda: robot.truth_time() >= last - 0.05, "the truth of the last moment")

    def later(stamp):
        return round(seconds(stamp) - began, 6)

    heard = [
        (topic, later(m.header.stamp), content(topic, m))
        for topic in (IMAGE, "scan", "odom")
        for m in robot.heard[topic]
        if began < seconds(m.header.stamp) < last
    ]
    truths = [
        (later(m.header.stamp), m.x, m.y, m.yaw, m.tilt, m.v, m.w, m.collisions)
        for m in robot.heard["ground_truth/state"]
        if began < seconds(m.header.stamp) < last
    ]
    moments = [
        tuple(later(getattr(m, name)) for name in ("stamp", "image", "scan", "odometry"))
        for m in policy.moments[first:]
    ]
    return heard, truths, moments


def free_start():
    """A pose with a metre of free floor ahead."""
    world = World(generate_room(*parse_room(ROOM)))
    for x in np.arange(0.5, world.room.width - 1.2, 0.1):
        for y in np.arange(0.5, world.room.depth, 0.1):
            if world.sweep_free((x, y), (x + 1.0, y)):
                return [float(x), float(y), 0.0]
    raise AssertionError("no free floor")


def content(topic, message):
    if topic == "odom":
        return repr(message.pose), repr(message.twist)
    return bytes(message.data if topic == IMAGE else message.ranges)


def test_time_stands_while_the_policy_is_idle(policy):
    robot = policy.listener
    heard, looks = (0, 0), 0

    def stands():
        nonlocal heard, looks
        now = len(policy.moments), len(robot.heard["ground_truth/state"])
        looks = looks + 1 if now == heard else 0
        heard = now
        return looks > 20

    robot.wait(stands, "no moment and no state in 20 looks of 0.05 s")


def test_moments_announce_what_was_published_last(policy):
    _, _, moments = drive(policy, 1, free_start())
    stamps, images, scans, _ = zip(*moments, strict=True)
    gaps = [b - a for a, b in itertools.pairwise(stamps)]
    assert gaps == pytest.approx([0.05] * len(gaps))
    for stamp, image, scan, counted in moments:
        # Pictures come 0.05 s late and every 0.067 s, odometry 0.02 s late and every 0.05 s.
        assert 0.05 - 1e-6 <= stamp - image <= 0.05 + 1 / 15 + 0.02
        assert stamp - counted == pytest.approx(0.05, abs=1e-6)
        # A scan is stamped with the beginning of its turn.
        assert 0.129 <= stamp - scan <= 2 * 0.13 + 0.02
    assert list(images) == sorted(images)
    assert list(scans) == sorted(scans)


def test_episode_repeats_itself_to_the_last_bit(policy):
    first, again, other = (drive(policy, seed, free_start()) for seed in (7, 7, 8))
    assert first[1] == again[1]
    assert first[2] == again[2]
    assert first[0] == again[0]
    assert first[0] != other[0]
    assert len(first[0]) > 100
    assert max(abs(truth[5]) for truth in first[1]) > 0.15
