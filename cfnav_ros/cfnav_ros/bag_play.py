"""Play what the sensors of a recorded drive said: ``python -m cfnav_ros.bag_play BAG``.

The real nodes run against it with ``use_sim_time``, as ``/clock`` tells the time of the drive. What
is played is written in ``bags/sources.py``, and when in ``bags/playing.py``; never a command, nor
anything that was concluded. Nothing of it reaches a robot: it plays on this machine only, in a ROS
domain of its own, and nothing that somebody else publishes there.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from importlib import import_module
from typing import Any

import rclpy
import tyro
from builtin_interfaces.msg import Time
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock
from tqdm import tqdm

from cfnav_ros.bags.playing import Beat, Play, PlayOptions, cut
from cfnav_ros.bags.reading import Bag, BagError, find_bags
from cfnav_ros.bags.roles import assign
from cfnav_ros.bags.sources import SENSORS, Offer, Source, choose
from cfnav_ros.processes import DISCOVERY_S, GraphError, stay_apart
from cfnav_ros.stop_signal import StopSignal

NAME = "bag_play"
CLOCK = "/clock"

TICK_NS, FAST_TICK_NS = 10_000_000, 50_000_000
"""Between two messages of /clock: real time, and node time where nothing waits."""

SETTLE_S = 0.5
"""A listener that this end has found may need so long to find this end, and its node the time."""

LOOK_S = 1.0
"""Between looks for somebody else who publishes the same."""

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
        self._context = Context()
        rclpy.init(
            context=self._context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self._node = Node(
            NAME, context=self._context, enable_rosout=False, start_parameter_services=False
        )
        self._publishers: dict[str, Any] = {}

    def __enter__(self) -> Player:
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the domain once those who listen have got the last messages."""
        for publisher in self._publishers.values():
            with suppress(RuntimeError):
                publisher.wait_for_all_acked(Duration(seconds=0.2))
        self._node.destroy_node()
        self._context.try_shutdown()

    def offer(self, sources: Sequence[Source]) -> list[str]:
        """Make the publishers, where nobody else publishes the same.

        Returns:
            Sentences about those whose type is not here.

        Raises:
            GraphError: somebody else publishes one of the topics.
        """
        notes, kinds = [], {}
        for source in sources:
            package, _, kind = source.topic.type.partition("/msg/")
            try:
                kinds[source] = getattr(import_module(f"{package}.msg"), kind)
            except (ImportError, AttributeError):
                notes.append(f"{source.topic.name} is left out: {source.topic.type} is not here.")
        names = [CLOCK, *(source.name for source in kinds)]
        end = time.monotonic() + DISCOVERY_S
        while time.monotonic() < end and not self._stop:
            self._refuse_others(names, ours=0)
            time.sleep(0.1)
        self._publishers[CLOCK] = self._node.create_publisher(Clock, CLOCK, 10)
        for source, kind in kinds.items():
            publisher = self._node.create_publisher(kind, source.name, _qos(source.offer))
            self._publishers[source.name] = publisher
        return notes

    def installed(self, sources: Sequence[Source]) -> dict[str, str]:
        """Hashes of the message types that this machine has."""
        found = {}
        for source in sources:
            if source.name in self._publishers:
                infos = self._node.get_publishers_info_by_topic(source.name)
                found |= {info.topic_type: str(info.topic_type_hash) for info in infos}
        return found

    def wait(self, names: Sequence[str], patience_s: float, need_all: bool) -> None:
        """Wait until somebody listens to all or any of some topics.

        Raises:
            GraphError: nobody does in time.
        """
        asked = all if need_all else any
        matched = [self._publishers[name] for name in names if name in self._publishers]
        end = time.monotonic() + patience_s
        while not asked(publisher.get_subscription_count() for publisher in matched):
            if self._stop:
                return
            if time.monotonic() > end:
                raise GraphError(self._unheard(names, patience_s))
            time.sleep(0.05)

    def play(self, beats: Iterator[Beat], rate: float, shown: Callable[[Beat], None]) -> None:
        """Publish everything at its time.

        Args:
            beats: in order.
            rate: seconds of the play per second, 0 for no waiting.
            shown: told of every one.

        Raises:
            GraphError: somebody else has begun to publish one of the topics.
        """
        clock_ns, looked, began = 0, time.monotonic(), None
        for beat in beats:
            if began is None:
                began = self._settle(beat.clock_ns) if rate else 0.0
            if rate:
                late_s = self._until(began + beat.at_ns * 1e-9 / rate)
                began, self.late_s = began + late_s, self.late_s + late_s
            if self._stop:
                return
            if time.monotonic() - looked > LOOK_S:
                looked = time.monotonic()
                self._refuse_others([*self._publishers], ours=1)
            if beat.clock_ns != clock_ns:
                clock_ns = beat.clock_ns
                self._tick(clock_ns)
            if beat.source and beat.source.name in self._publishers:
                self._publishers[beat.source.name].publish(beat.data)
                self.played += 1
            shown(beat)

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

    def _refuse_others(self, names: Sequence[str], ours: int) -> None:
        for name in names:
            infos = self._node.get_publishers_info_by_topic(name)
            if len(infos) > ours:
                nodes = sorted({info.node_name for info in infos} - ({NAME} if ours else set()))
                raise GraphError(
                    f"{' and '.join(nodes) or 'another ' + NAME} publishes {name} in ROS domain "
                    f"{self._context.get_domain_id()}: end it, or choose another --domain."
                )

    def _unheard(self, names: Sequence[str], patience_s: float) -> str:
        """Why nobody was found who listens."""
        silent = [
            name
            for name in names
            if name in self._publishers and not self._publishers[name].get_subscription_count()
        ]
        for name in silent:
            if infos := self._node.get_subscriptions_info_by_topic(name):
                return (
                    f"{infos[0].node_name} listens to {name}, but with another quality of service "
                    "or type than the bag has: it would hear nothing."
                )
        return (
            f"Nobody listened to any of {', '.join(silent)} within {patience_s:.0f} s: start the "
            f"nodes in ROS domain {self._context.get_domain_id()} here, or give --wait 0."
        )


def _qos(offer: Offer) -> QoSProfile:
    reliability, durability = ReliabilityPolicy, DurabilityPolicy
    return QoSProfile(
        depth=offer.depth,
        reliability=reliability.RELIABLE if offer.reliable else reliability.BEST_EFFORT,
        durability=durability.TRANSIENT_LOCAL if offer.latched else durability.VOLATILE,
    )


def _play(options: PlayOptions, bag: Bag, stop: StopSignal) -> int:
    """Play an open bag; returns 0 when everything was played, 1 when not."""
    chosen = choose(bag.topics, options.topic, options.namespace, options.names == "recorded")
    wanted = _waited_for(options, chosen.sources)
    with Player(stay_apart(os.environ, options.domain), stop) as player:
        for note in (*chosen.notes, *player.offer(chosen.sources)):
            print(f"{NAME}: {note}", file=sys.stderr)
        if options.wait:
            print(f"{NAME}: waiting until somebody listens", file=sys.stderr)
            player.wait(wanted, options.wait, bool(options.wait_for))
        clock = assign(bag.topics).topics.get("clock")
        play = Play(bag, chosen.sources, clock, player.installed(chosen.sources))
        tick_ns = round(TICK_NS * max(1.0, options.rate)) if options.rate else FAST_TICK_NS
        beats = cut(play.beats(tick_ns), round(options.start * 1e9), options.duration * 1e9)
        print(f"{NAME}: playing {bag.path}", file=sys.stderr)
        failed = _run(player, beats, options.rate, play.count)
        play.finish()
        return _tell(player, bag, failed)


def _run(player: Player, beats: Iterator[Beat], rate: float, count: int | None) -> str:
    """Play with a bar of progress; returns why it broke off."""
    with tqdm(total=count, unit=" messages", disable=None, leave=False) as bar:

        def show(beat: Beat) -> None:
            if beat.source:
                bar.update()
                bar.set_postfix_str(f"{beat.at_ns * 1e-9:.1f} s", refresh=False)

        try:
            player.play(beats, rate, show)
        except GraphError as error:
            return str(error)
    return ""


def _tell(player: Player, bag: Bag, failed: str) -> int:
    """Say what was played and what was not; returns the exit code."""
    notes = [*bag.notes]
    if player.late_s:
        print(f"{NAME}: the play was held up for {player.late_s:.1f} s", file=sys.stderr)
    for note in notes:
        print(f"{NAME}: {note}", file=sys.stderr)
    print(f"{NAME}: {player.played} messages played", file=sys.stderr)
    if failed or not player.played:
        print(f"{NAME}: {failed or 'there was nothing to play'}", file=sys.stderr)
    return 1 if failed or notes or not player.played else 0


def _waited_for(options: PlayOptions, sources: Sequence[Source]) -> list[str]:
    """Names of the topics that somebody must listen to.

    Raises:
        ValueError: a role is none, or nothing plays it.
    """
    names = {source.role: source.name for source in sources}
    for role in options.wait_for:
        if role not in names:
            raise ValueError(
                f"--wait-for is {role!r}, expected one of those that the bag has: "
                f"{', '.join(role for role in SENSORS if role in names)}."
            )
    return [names[role] for role in options.wait_for or names]


def run(options: PlayOptions) -> int:
    """Play a bag; returns the exit code.

    Returns:
        0 when everything was played or a signal ended it, 1 when some of it could not be, 2 when
        it could not begin.
    """
    stop = StopSignal()
    try:
        options.check()
        bags = find_bags([options.bag])
        if len(bags) > 1:
            raise BagError(f"{options.bag} holds {len(bags)} bags, expected one: name it.")
        with Bag(bags[0]) as bag:
            code = _play(options, bag, stop)
    except (BagError, GraphError, ValueError) as error:
        print(f"{NAME}: {error}", file=sys.stderr)
        return 2
    return 0 if stop else code


def main() -> int:
    """Run the command line; the exit code is that of ``run``."""
    return run(tyro.cli(PlayOptions, prog=NAME))


if __name__ == "__main__":
    sys.exit(main())
