"""One time for all events of a bag, although some of its stamps may come from another clock. Pure.

Nodes stamp with their own clock, the recorder logs with its own. Where both agree but for the way
a message takes, the stamp says when something was; where they do not, only log times compare.
"""

from __future__ import annotations

import statistics
from collections import deque

from cfnav_ros.bags.files.events import Event

OTHER_CLOCK_S = 1.0
"""Stamps usually further than this from the log times come from another clock: the robot's limits
(``inputs.AgeLimits``) accept nothing older."""

LOOKED_AT = 15
"""Messages of a topic whose median decides, so that one late message does not: a second of
pictures, two of scans."""

OTHER_CLOCK_NS = round(OTHER_CLOCK_S * 1e9)


STEP_NS, ENOUGH_NS = 2_000_000_000, 2_000_000_000
"""Longer gaps between two messages tell nothing of a pace, and less than this in all not enough."""

OTHER_PACE = 1.5
"""Clocks of which one runs so many times as fast as the other: commands and odometry that were
told apart by log times then compare metres a second of the one with seconds of the other."""


class Pace:
    """How fast a topic's stamps run beside the log times: a simulator's clock may run slower."""

    def __init__(self) -> None:
        self._last: tuple[int, int] | None = None
        self._stamps = self._logs = 0

    def take(self, event: Event) -> None:
        """Take the topic's next message."""
        if event.log_ns <= 0 or event.t_ns <= 0:
            return
        now = event.t_ns, event.log_ns
        if self._last:
            stamps, logs = now[0] - self._last[0], now[1] - self._last[1]
            if 0 < stamps < STEP_NS and 0 < logs < STEP_NS:
                self._stamps, self._logs = self._stamps + stamps, self._logs + logs
        self._last = now

    @property
    def other(self) -> float | None:
        """Seconds of the stamps in one of the log, where these are two paces."""
        if self._logs < ENOUGH_NS:
            return None
        pace = self._stamps / self._logs
        return None if 1 / OTHER_PACE < pace < OTHER_PACE else pace


class Clocks:
    """Gives each event its time, nanoseconds."""

    def __init__(self) -> None:
        self._behind: dict[str, deque[int]] = {}

    def behind(self, event: Event) -> int:
        """How far the topic's stamps lie behind the log times now, nanoseconds; 0 if unknown.

        The median of the last messages; an event without log time or stamp tells nothing.
        """
        behind = self._behind.setdefault(event.topic, deque(maxlen=LOOKED_AT))
        if event.log_ns > 0 and event.t_ns > 0:
            behind.append(event.log_ns - event.t_ns)
        return statistics.median_low(behind) if behind else 0

    def time(self, event: Event) -> int:
        """The stamp of an event, or its log time where its topic's stamps are of another clock."""
        behind = self.behind(event)
        if event.log_ns <= 0 or (event.t_ns > 0 and abs(behind) <= OTHER_CLOCK_NS):
            return event.t_ns
        return event.log_ns
