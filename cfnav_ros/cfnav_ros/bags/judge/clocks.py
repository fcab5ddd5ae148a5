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
