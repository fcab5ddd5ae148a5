"""Records the graph's topics into one MCAP bag.

Raw subscriptions hand CDR bytes straight to the bag; nothing is decoded. Every picture is kept.
Messages are written in the order in which they reached this process, not in that in which a busy
executor takes them, topic by topic: the bag then tells who knew what when.
"""

from __future__ import annotations

import struct
import threading
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_path
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.subscription import Subscription
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)

from cfnav_core.robot.robot import Robot, load_robot
from cfnav_core.robot.settings import leaves
from cfnav_core.robot.topics import COMPRESSED, RAW, TOPICS, Topic
from cfnav_ros.bags.files.arrival_order import ArrivalOrder
from cfnav_ros.bags.files.recorded_robot import said_of, told_of
from cfnav_ros.bags.files.writer import BagWriter, typestore_with
from cfnav_ros.drive.policy_parameters import PolicyParameters
from cfnav_ros.drive.preflight import explain_silence
from cfnav_ros.lidar.scan_watch import LidarParameters
from cfnav_ros.ros import conversions
from cfnav_ros.ros.parameters import ToldParameters
from cfnav_ros.ros.spinning import SpinningThread
from cfnav_ros.ros.topics import message_type, quality

NODE_NAME = "recorder"
"""The policy node knows by this name that a listener on ``cmd_vel`` is no robot."""

QUEUE = 1000
"""Messages of a topic that wait when the machine is busy: seconds even at many times real time."""

PICTURES = 300
"""The same of pictures, which are large."""

LOOK_S = 0.2
"""Real time between looks at what the graph knows: the type of a topic that may have two, the
quality of service that is offered, and nodes that can say what they were told."""

CLOCK = TOPICS["clock"].name

PACKAGES = ("cfnav_interfaces", "irobot_create_msgs", "vision_msgs")
"""Packages whose definitions the bag library does not know by itself."""

ASKED = {
    node: [name for name, _ in leaves(parameters) if name != "robot"]
    for node, parameters in (
        ("policy_node", PolicyParameters()), ("lidar_collision_node", LidarParameters())
    )
}  # fmt: skip
"""What these nodes are asked that they were told: all but the robot, which the bag has itself."""


class Recorder:
    """A node with its own thread that writes what it hears until it is closed.

    Log times are those of ``/clock`` when a message arrived, or 0 before its first one; on a robot,
    which has no such topic, those of the system.
    """

    def __init__(
        self, bag: Path, context: Context, system_time: bool = False, robot: Robot | None = None
    ) -> None:
        """Open the bag and subscribe.

        Args:
            bag: folder of the finished bag.
            context: an initialised rclpy context; the caller shuts it down after ``close``.
            system_time: log system time instead of that of ``/clock``.
            robot: whose topics, which the bag then says; those of ``DEFAULT`` when None.

        Raises:
            FileExistsError: the bag exists, or what a recording that broke off left of it.
            FileNotFoundError: a message package is not built.
        """
        shares = [get_package_share_path(name) for name in PACKAGES]
        said = said_of(robot) if robot else {}
        self._writer = BagWriter(bag, typestore_with(shares), said)
        self._system_time, self._clock_ns = system_time, 0
        self._held: ArrivalOrder[tuple[str, bytes]] = ArrivalOrder()
        self._counts: Counter[str] = Counter()
        self._heard = threading.Condition()
        self._error: Exception | None = None
        self._node = Node(NODE_NAME, context=context)
        self._told = ToldParameters(self._node, ASKED)
        self._undecided: list[Topic] = []
        self._subscriptions: dict[str, tuple[Topic, Subscription]] = {}
        self._topics = (robot or load_robot()).topics
        for topic in self._topics.values():
            if topic.other_type:
                self._undecided.append(topic)
            elif topic.recorded:
                self._subscribe(topic)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._node.create_timer(LOOK_S, self._look, clock=steady)
        self._thread = SpinningThread(self._node, self._fail)
        self._thread.start()

    @property
    def counts(self) -> Counter[str]:
        """How many messages of each topic have been heard, by resolved names."""
        self._raise_error()
        return self._counts.copy()

    def count(self, role: str) -> int:
        """Return how many messages of the topic that plays a role have been heard."""
        return self.counts[self._node.resolve_topic_name(self._topics[role].name)]

    @property
    def told(self) -> Mapping[str, Mapping[str, Any]]:
        """What the nodes of ``ASKED`` were told, of those that have answered."""
        return self._told.said

    def wait_for(self, role: str, count: int, deadline_s: float = 10.0) -> bool:
        """Wait until a topic has at least so many messages; false when the deadline passed."""
        end = time.monotonic() + deadline_s
        with self._heard:
            while self.count(role) < count and (left := end - time.monotonic()) > 0:
                self._heard.wait(left)
        return self.count(role) >= count

    def unheard(self) -> list[str]:
        """One sentence for each topic that somebody publishes and of which nothing has come.

        And for each node that does not say what it was told.
        """
        found = [
            f"{name} does not say what it was told, which the bag will lack: use one cfnav."
            for name in self._told.silent()
        ]
        for name, (topic, subscription) in [*self._subscriptions.items()]:
            infos = self._node.get_publishers_info_by_topic(name)
            if infos and not self.counts[name]:
                sources = conversions.sources(infos, subscription)
                reason = explain_silence(name, topic.type, sources) or "it is published, but silent"
                found.append(f"{name} was not heard so far: {reason}.")
        return found

    def close(self) -> None:
        """Stop listening and finish the bag.

        Raises:
            OSError: the bag could not be written, such as on a full disk; what was is left.
        """
        names = [(self._node.resolve_topic_name(topic.name), topic) for topic in self._undecided]
        self._stop()
        if self._error is not None:
            self._writer.leave()
            raise self._error
        self._write(self._held.rest())
        for name, topic in names:  # a bag has all topics, silent ones too
            self._writer.add_topic(name, topic.type, [_bag_qos(topic)])
        self._writer.say(told_of(self._told.said))
        self._writer.close()

    def leave(self) -> Path:
        """Stop listening and leave what was written where it is; returns its folder."""
        self._stop()
        with suppress(OSError):
            self._write(self._held.rest())
        self._writer.leave()
        return self._writer.partial

    def abort(self) -> None:
        """Stop listening and leave no bag."""
        self._stop()
        self._writer.abort()

    def _subscribe(self, topic: Topic) -> None:
        name = self._node.resolve_topic_name(topic.name)
        self._writer.add_topic(name, topic.type, [_bag_qos(topic)])
        self._listen(name, topic)

    def _listen(self, name: str, topic: Topic) -> None:
        subscription = self._node.create_subscription(
            message_type(topic.type),
            topic.name,
            partial(self._take, name),
            quality(topic, PICTURES if topic.type in (RAW, COMPRESSED) else QUEUE),
            # Handlers of events that nobody reads would double the cost of every message.
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            raw=True,
        )
        self._subscriptions[name] = topic, subscription

    def _look(self) -> None:
        self._decide()
        self._told.ask(time.monotonic())

    def _decide(self) -> None:
        """Listen in the type that the graph knows, and ask for no more than what is offered.

        What asks for more is not heard at all, as odometry of which nothing is kept for the late.
        Where one of several keeps it, that one is heard.
        """
        for name, (topic, subscription) in [*self._subscriptions.items()]:
            there = self._node.get_publishers_info_by_topic(name)
            offers = [info.qos_profile for info in there if info.topic_type == topic.type]
            best_effort = any(o.reliability == ReliabilityPolicy.BEST_EFFORT for o in offers)
            volatile = {o.durability for o in offers} == {DurabilityPolicy.VOLATILE}
            asked = replace(
                topic, reliable=topic.reliable and not best_effort,
                latched=topic.latched and not volatile,
            )  # fmt: skip
            if asked != topic:
                self._node.destroy_subscription(subscription)
                self._listen(name, asked)
        for topic in [*self._undecided]:
            name = self._node.resolve_topic_name(topic.name)
            infos = (
                *self._node.get_subscriptions_info_by_topic(name),
                *self._node.get_publishers_info_by_topic(name),
            )
            types = {info.topic_type for info in infos}
            kind = next((kind for kind in (topic.type, topic.other_type) if kind in types), None)
            if kind is not None:
                self._undecided.remove(topic)
                self._subscribe(replace(topic, type=kind))

    def _take(self, name: str, cdr: bytes, info: Mapping[str, int]) -> None:
        # some middlewares do not tell when it arrived
        arrived_ns = info["received_timestamp"] or time.time_ns()
        self._counts[name] += 1
        self._write(self._held.take(arrived_ns, (name, cdr), time.monotonic_ns()))
        with self._heard:
            self._heard.notify_all()

    def _write(self, messages: Iterable[tuple[int, tuple[str, bytes]]]) -> None:
        """Write messages with the times of their arrival, ns of the system's clock."""
        for arrived_ns, (name, cdr) in messages:
            if name == CLOCK:
                # After the 4 bytes of encapsulation: int32 seconds, uint32 nanoseconds.
                order = "<" if cdr[1] & 1 else ">"
                seconds, nanoseconds = struct.unpack_from(order + "iI", cdr, 4)
                self._clock_ns = seconds * 1_000_000_000 + nanoseconds
            self._writer.write(name, arrived_ns if self._system_time else self._clock_ns, cdr)

    def _fail(self, error: Exception) -> None:
        with self._heard:
            self._error = error  # raised again in the caller's thread
            self._heard.notify_all()

    def _raise_error(self) -> None:
        if self._error is not None:
            raise self._error

    def _stop(self) -> None:
        self._thread.end()
        self._node.destroy_node()


def _bag_qos(topic: Topic) -> Qos:
    """Return the profile with which a player of the bag should offer the topic."""
    forever = QosTime(0x7FFFFFFFFFFFFFFF // 10**9, 0x7FFFFFFFFFFFFFFF % 10**9)
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=topic.depth,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL if topic.latched else QosDurability.VOLATILE,
        deadline=forever,
        lifespan=forever,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=forever,
        avoid_ros_namespace_conventions=False,
    )
