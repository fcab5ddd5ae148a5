"""Which episode messages are older than the bag: the last ones reach late listeners too. Pure.

A recorder that comes late is handed the newest messages of a latched topic at once. Their stamps
tell, but only beside what the bag begins with on the same clock: a simulation's time is not the
system's, and a recorder in simulated time logs 0 until it has heard ``/clock``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from cfnav_ros.bags.files.events import Event, Frames, OccupancyMap, Picture, Tick, Told, Velocity
from cfnav_ros.robot.stamps import OTHER_TIME_S

OLDER_S = 1.0
"""Stamped this long before the bag begins, a message was published before anybody recorded."""

MOST_HELD = 4096
"""Events held until it is known when the bag begins; a clock that stands must not fill memory."""

NOT_LIVE = (Told, Frames, OccupancyMap, Velocity)
"""Latched, or without a stamp of its own: their times do not tell when the bag begins."""

_OLDER_NS, _OTHER_NS = round(OLDER_S * 1e9), round(OTHER_TIME_S * 1e9)


class Latched:
    """Tells episode messages from before the bag; feed it every event in the order of log times."""

    def __init__(self) -> None:
        self._held: list[Event] = []
        self._begin_ns: int | None = None  # by log time
        self._live_ns: int | None = None  # by the stamps of what is no latched message
        self._simulated = self._given_up = False

    def see(self, event: Event) -> Iterator[tuple[Event, bool]]:
        """Take the next event.

        Yields:
            Events in the order in which they came, as soon as it is known when the bag begins,
            each with whether it is an episode message from before; such a one is stamped with the
            bag's beginning. Pictures are not held but left
            out.
        """
        if self._begin_ns is None and event.log_ns > 0:
            self._begin_ns = event.log_ns
        self._simulated |= isinstance(event, Tick)
        if not isinstance(event, NOT_LIVE):
            self._live_ns = min(event.t_ns, self._live_ns or event.t_ns)
        if isinstance(event, Picture) and (self._held or not self._known()):
            return  # it would fill the memory
        self._held.append(event)
        self._given_up |= len(self._held) > MOST_HELD
        if self._given_up or self._known():
            yield from self.finish()

    def finish(self) -> Iterator[tuple[Event, bool]]:
        """The bag is over: what is still held, as from ``see``."""
        held, self._held = self._held, []
        for event in held:
            begin_ns = self._begin_before(event) if isinstance(event, Told) else None
            if begin_ns is None:
                yield event, False
            else:
                yield replace(event, t_ns=begin_ns), True

    def _known(self) -> bool:
        """Whether the held messages can be told."""
        if self._begin_ns is None:
            return False
        told = [event for event in self._held if isinstance(event, Told)]
        return self._live_ns is not None or not any(map(_of_another_time, told))

    def _begin_before(self, told: Told) -> int | None:
        """When the bag begins on the message's clock if the message is older, else None."""
        begin_ns, live_ns = self._begin_ns, self._live_ns
        one_clock = self._simulated or told.log_ns <= 0 or _of_another_time(told)
        if one_clock and live_ns is not None and _older(told, live_ns):
            return live_ns
        # A robot's clocks differ from the recorder's, so its first messages alone can be told.
        first = begin_ns is not None and told.log_ns - begin_ns <= _OLDER_NS
        if first and told.log_ns > 0 and _older(told, told.log_ns):
            return begin_ns
        return None


def _of_another_time(told: Told) -> bool:
    """Whether its stamp and its log time are of simulated time and the system's."""
    return abs(told.log_ns - told.t_ns) >= _OTHER_NS


def _older(told: Told, begin_ns: int) -> bool:
    return _OLDER_NS < begin_ns - told.t_ns < _OTHER_NS
