"""Play what the sensors of a recorded drive said: ``python -m cfnav_ros.bag_play BAG``.

The real nodes run against it with ``use_sim_time``, as ``/clock`` tells the time of the drive. What
is played is written in ``bags/sources.py``, and when in ``bags/playing.py``; never a command, nor
anything that was concluded. Nothing of it reaches a robot: it plays on this machine only, in a ROS
domain of its own, and nothing that somebody else publishes there.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from importlib import import_module

import tyro
from tqdm import tqdm

from cfnav_ros.bag_player import NAME, Player
from cfnav_ros.bags.playing import Beat, Play, PlayOptions, cut
from cfnav_ros.bags.reading import Bag, BagError, find_bags
from cfnav_ros.bags.roles import assign
from cfnav_ros.bags.sources import SENSORS, Source, choose
from cfnav_ros.processes import GraphError, stay_apart
from cfnav_ros.stop_signal import StopSignal

TICK_NS, FAST_TICK_NS = 10_000_000, 50_000_000
"""Between two messages of /clock: real time, and node time where nothing waits."""


def _play(options: PlayOptions, bag: Bag, stop: StopSignal) -> int:
    """Play an open bag; returns 0 when everything was played, 1 when not."""
    chosen = choose(bag.topics, options.topic, options.namespace, options.names == "recorded")
    _say(*chosen.notes)
    kinds = _kinds(chosen.sources, bag)
    wanted = _waited_for(options, kinds)
    with Player(stay_apart(os.environ, options.domain), stop) as player:
        player.offer(kinds)
        if options.wait:
            _say("waiting until somebody listens")
            player.wait(wanted, options.wait, bool(options.wait_for))
        play = Play(bag, kinds, assign(bag.topics).topics.get("clock"), player.installed())
        tick_ns = round(TICK_NS * max(1.0, options.rate)) if options.rate else FAST_TICK_NS
        beats = cut(play.beats(tick_ns), round(options.start * 1e9), options.duration * 1e9)
        _say(f"playing {bag.path}")
        failed = _run(player, beats, options.rate, play.count)
        if player.late_s:
            _say(f"the play was held up for {player.late_s:.1f} s")
        _say(*play.finish(), *bag.notes, f"{player.played} messages played")
        if stop:
            _say("told to end")
        elif failed or not player.played:
            _say(failed or "there was nothing to play")
        return 1 if failed or len(bag.notes) or not player.played else 0


def _kinds(sources: Sequence[Source], bag: Bag) -> dict[Source, type]:
    """The message types of those that this machine has; the bag's notes say which it lacks.

    Raises:
        ValueError: it has none.
    """
    kinds = {}
    for source in sources:
        package, _, kind = source.topic.type.partition("/msg/")
        try:
            kinds[source] = getattr(import_module(f"{package}.msg"), kind)
        except (ImportError, AttributeError):
            bag.notes.add(f"{source.topic.name} is left out: {source.topic.type} is not here.")
    if not kinds:
        raise ValueError("None of the bag's message types is here: source the workspace.")
    return kinds


def _say(*sentences: str) -> None:
    for sentence in sentences:
        print(f"{NAME}: {sentence}", file=sys.stderr)


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


def _waited_for(options: PlayOptions, sources: Iterable[Source]) -> list[str]:
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
            try:
                code = _play(options, bag, stop)
            except ValueError:
                _say(*bag.notes)  # they may say why there is nothing to play
                raise
    except (BagError, GraphError, ValueError) as error:
        _say(str(error))
        code = 2
    stopped = bool(stop)
    stop.ignore()
    return 0 if stopped else code


def main() -> int:
    """Run the command line; the exit code is that of ``run``."""
    return run(tyro.cli(PlayOptions, prog=NAME))


if __name__ == "__main__":
    sys.exit(main())
