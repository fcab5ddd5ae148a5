"""Play what the sensors of a recorded drive said: ``cfnav bag play BAG``.

The real nodes run against it with ``use_sim_time``, as ``/clock`` tells the time of the drive. What
is played is written in ``bags/files/sources.py``, and when in ``bags/files/playing.py``; never a
command, nor anything that was concluded. Nothing of it reaches a robot: it plays on this machine
only, in a ROS domain of its own, and nothing that somebody else publishes there.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from tqdm import tqdm

from cfnav_core.command import DONE, PARTLY, run_options
from cfnav_ros.bags.files.finding import BagError, find_bags
from cfnav_ros.bags.files.playing import Cue, Play, PlayOptions, cut
from cfnav_ros.bags.files.reading import Bag
from cfnav_ros.bags.files.recorded_robot import robot_for
from cfnav_ros.bags.files.roles import assign
from cfnav_ros.bags.files.sources import SENSORS, PlayedTopic, choose
from cfnav_ros.process.domains import Domain, stay_apart
from cfnav_ros.process.processes import GraphError
from cfnav_ros.process.stop_signal import StopSignal
from cfnav_ros.ros.bag_player import NAME, Player
from cfnav_ros.ros.topics import message_type

TICK_NS, FAST_TICK_NS = 10_000_000, 50_000_000
"""Between two messages of /clock: real time, and node time where nothing waits."""


def _play(options: PlayOptions, bag: Bag, stop: StopSignal) -> int:
    """Play an open bag; returns whether everything was played, as an exit code."""
    recorded, robot = options.names == "recorded", robot_for(bag, options.robot)
    chosen = choose(bag.topics, options.topic, options.namespace, recorded, robot)
    _say(*chosen.notes)
    kinds = _kinds(chosen.sources, bag)
    wanted = _waited_for(options, kinds)
    number = stay_apart(os.environ, options.domain)
    with Domain(number), Player(number, stop) as player:
        player.offer(kinds)
        if options.wait:
            _say("waiting until somebody listens")
            player.wait(wanted, options.wait, bool(options.wait_for))
        play = Play(bag, kinds, assign(bag.topics).topics.get("clock"), player.installed())
        tick_ns = round(TICK_NS * max(1.0, options.rate)) if options.rate else FAST_TICK_NS
        cues = cut(play.cues(tick_ns), round(options.start * 1e9), options.duration * 1e9)
        _say(f"playing {bag.path}")
        failed = _run(player, cues, options.rate, play.count)
        if player.late_s:
            _say(f"the play was held up for {player.late_s:.1f} s")
        _say(*play.finish(), *bag.notes, f"{player.played} messages played")
        if stop:
            _say("told to end")
        elif failed or not player.played:
            _say(failed or "there was nothing to play")
        return PARTLY if failed or len(bag.notes) or not player.played else DONE


def _kinds(sources: Sequence[PlayedTopic], bag: Bag) -> dict[PlayedTopic, type]:
    """The message types of those that this machine has; the bag's notes say which it lacks.

    Raises:
        ValueError: it has none.
    """
    kinds = {}
    for source in sources:
        try:
            kinds[source] = message_type(source.topic.type)
        except (ImportError, AttributeError):
            bag.notes.add(f"{source.topic.name} is left out: {source.topic.type} is not here.")
    if not kinds:
        raise ValueError("None of the bag's message types is here: source the workspace.")
    return kinds


def _say(*sentences: str) -> None:
    for sentence in sentences:
        print(f"{NAME}: {sentence}", file=sys.stderr)


def _run(player: Player, cues: Iterator[Cue], rate: float, count: int | None) -> str:
    """Play with a bar of progress; returns why it broke off."""
    with tqdm(total=count, unit=" messages", disable=None, leave=False) as bar:

        def show(cue: Cue) -> None:
            if cue.source:
                bar.update()
                bar.set_postfix_str(f"{cue.at_ns * 1e-9:.1f} s", refresh=False)

        try:
            player.play(cues, rate, show)
        except GraphError as error:
            return str(error)
    return ""


def _waited_for(options: PlayOptions, sources: Iterable[PlayedTopic]) -> list[str]:
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


@dataclass(frozen=True)
class BagPlay(PlayOptions):
    """Play what the sensors of a recorded drive said into a graph on this machine."""

    def run_command(self) -> int:
        """Play a bag.

        Returns:
            0 when everything was played or a signal ended it, 1 when some of it could not be.

        Raises:
            BagError: there is no such bag.
            GraphError: the domain is somebody's.
            ValueError: an option makes no sense, or there is nothing to play.
        """
        stop = StopSignal()
        try:
            self.check()
            bags = find_bags([self.bag])
            if len(bags) > 1:
                raise BagError(f"{self.bag} holds {len(bags)} bags, expected one: name it.")
            with Bag(bags[0]) as bag:
                try:
                    code = _play(self, bag, stop)
                except ValueError:
                    _say(*bag.notes)  # they may say why there is nothing to play
                    raise
            return DONE if stop else code
        finally:
            stop.ignore()


def main() -> int:
    """Entry point of ``ros2 run cfnav_ros bag_play``; the exit code is ``ending``'s."""
    return run_options(NAME, BagPlay)
