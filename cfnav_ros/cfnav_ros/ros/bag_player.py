"""Publishes a recorded drive and ``/clock`` in a graph that is no robot's; ``bag_play`` runs it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from cfnav_ros.bags.files.playing import Cue
from cfnav_ros.bags.files.sources import PlayedTopic
from cfnav_ros.drive.preflight import UNKNOWN_NODE
from cfnav_ros.process.processes import DISCOVERY_S, GraphError
from cfnav_ros.process.stop_signal import StopSignal
from cfnav_ros.ros.spinning import join
from cfnav_ros.ros.topics import quality

NAME = "bag_play"
CLOCK = "/clock"

SETTLE_S = 0.5
"""A listener that this end has found may need so long to find this end, and its node the time."""

LOOK_S = 1.0
"""Between looks for somebody else who publishes the same."""

LINGER_S = 1.0
"""Listeners who listen best effort acknowledge nothing; a busy one may take so long."""

LATE_S = 0.5
"""A play that falls further behind, as on a machine that was suspended, does not catch up."""


class Player:
    """Publishes in a graph of its own; use it as a context manager."""

    def __init__(self, domain: int, stop: StopSignal) -> None:
        """Join the domain.

        Args:
            domain: ROS domain; the environment keeps it on this machine.
            stop: ends every wait.
        """
        self.late_s = 0.0
        self.played = 0
        self._stop = stop
        self._context = join(domain)
        self._node = Node(
            NAME, context=self._context, enable_rosout=False, start_parameter_services=False
        )
        self._publishers: dict[str, Any] = {}

    def __enter__(self) -> Player:
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the domain once those who listen have got the last messages."""
        if self.played:
            self._until(time.monotonic() + LINGER_S)
        for publisher in self._publishers.values():
            with suppress(RuntimeError):
                publisher.wait_for_all_acked(Duration(seconds=0.2))
        self._node.destroy_node()
        self._context.try_shutdown()

    def offer(self, kinds: Mapping[PlayedTopic, type]) -> None:
        """Make the publishers, where nobody else publishes the same.

        Args:
            kinds: message types of what is played.

        Raises:
            GraphError: somebody else publishes one of the topics.
        """
        self._refuse_others([CLOCK, *(source.name for source in kinds)])
        self._publishers[CLOCK] = self._node.create_publisher(Clock, CLOCK, 10)
        for source, kind in kinds.items():
            publisher = self._node.create_publisher(kind, source.name, quality(source.offer))
            self._publishers[source.name] = publisher

    def installed(self) -> dict[str, str]:
        """Hashes of the message types of the publishers, as this machine has them."""
        infos = [i for n in self._publishers for i in self._node.get_publishers_info_by_topic(n)]
        return {info.topic_type: str(info.topic_type_hash) for info in infos}

    def wait(self, names: Sequence[str], patience_s: float, need_all: bool) -> None:
        """Wait until somebody listens to all or any of some topics.

        Raises:
            GraphError: nobody does in time.
        """
        asked = all if need_all else any
        publishers = [self._publishers[name] for name in names]
        end = time.monotonic() + patience_s
        while not asked(publisher.get_subscription_count() for publisher in publishers):
            if self._stop:
                return
            if time.monotonic() > end:
                raise GraphError(self._unheard(names, patience_s))
            time.sleep(0.05)

    def play(self, cues: Iterator[Cue], rate: float, shown: Callable[[Cue], None]) -> None:
        """Publish everything at its time.

        Args:
            cues: in order.
            rate: seconds of the play per second, 0 for no waiting.
            shown: told of every one.

        Raises:
            GraphError: somebody else has begun to publish one of the topics.
        """
        clock_ns, looked, began = 0, 0.0, None
        for cue in cues:
            if began is None:
                began = self._settle(cue.clock_ns)
            if rate:
                late_s = self._until(began + cue.at_ns * 1e-9 / rate)
                began, self.late_s = began + late_s, self.late_s + late_s
            if self._stop:
                return
            if time.monotonic() - looked > LOOK_S:
                looked = time.monotonic()
                if other := self._other([*self._publishers], ours=1):
                    raise GraphError(other)
            if cue.clock_ns != clock_ns:
                clock_ns = cue.clock_ns
                self._tick(clock_ns)
            if cue.source:
                self._publishers[cue.source.name].publish(cue.data)
                self.played += 1
            shown(cue)

    def _settle(self, clock_ns: int) -> float:
        """Tell the first node time until everybody knows it; returns when that was."""
        end = time.monotonic() + SETTLE_S
        while (now := time.monotonic()) < end and not self._stop:
            if clock_ns:
                self._tick(clock_ns)
            time.sleep(0.05)
        return now

    def _until(self, moment: float) -> float:
        """Wait for a moment; returns by how much it was missed if that is too much to catch up."""
        late_s = time.monotonic() - moment
        while (left := moment - time.monotonic()) > 0 and not self._stop:
            time.sleep(min(left, 0.05))
        return late_s if late_s > LATE_S else 0.0

    def _tick(self, clock_ns: int) -> None:
        stamp = Time(sec=clock_ns // 10**9, nanosec=clock_ns % 10**9)
        self._publishers[CLOCK].publish(Clock(clock=stamp))

    def _refuse_others(self, names: Sequence[str]) -> None:
        """Look long enough to hear of everybody in the domain, and of their names."""
        other, end = "", time.monotonic() + DISCOVERY_S
        while time.monotonic() < end and not self._stop:
            other = self._other(names, ours=0)
            if other and UNKNOWN_NODE not in other:
                break
            time.sleep(0.1)
        if other:
            raise GraphError(other)

    def _other(self, names: Sequence[str], ours: int) -> str:
        """A sentence about somebody else who publishes one of the topics."""
        for name in names:
            infos = self._node.get_publishers_info_by_topic(name)
            if len(infos) > ours:
                nodes = sorted({info.node_name for info in infos} - ({NAME} if ours else set()))
                return (
                    f"{' and '.join(nodes) or 'another ' + NAME} publishes {name} in ROS domain "
                    f"{self._context.get_domain_id()}: end it, or choose another --domain."
                )
        return ""

    def _unheard(self, names: Sequence[str], patience_s: float) -> str:
        """Why nobody was found who listens."""
        silent = [name for name in names if not self._publishers[name].get_subscription_count()]
        for name in silent:
            if infos := self._node.get_subscriptions_info_by_topic(name):
                return (
                    f"{infos[0].node_name} listens to {name}, but with another quality of service "
                    "or type than the bag has: it would hear nothing."
                )
        return (
            f"Nobody listened to any of {', '.join(silent)} within {patience_s:g} s: start the "
            f"nodes in ROS domain {self._context.get_domain_id()} here, or give --wait 0."
        )
