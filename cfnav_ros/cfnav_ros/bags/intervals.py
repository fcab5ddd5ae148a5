"""Intervals of time in bounded memory. Pure."""

from __future__ import annotations

from dataclasses import dataclass

MOST = 48
"""Intervals kept of a kind and topic; the rest is counted."""

JOIN_S = 1.0
"""Intervals less than this apart are one: a report of each dropped message helps nobody."""


@dataclass
class Interval:
    """From ``start`` to ``end``, s from the start of the bag, with ``count`` occasions.

    ``low`` and ``high`` are the least and the greatest size of an occasion, whatever is measured.
    """

    start: float
    end: float
    low: float = 0.0
    high: float = 0.0
    count: int = 1

    @property
    def seconds(self) -> float:
        """How long it is."""
        return self.end - self.start


class Intervals:
    """Merges intervals that come in the order of their ends.

    Attributes:
        kept: the first of them.
        more: how many came after those.
        seconds: how long all of them are together.
        count: occasions in all of them.
    """

    def __init__(self, most: int = MOST, join: float = JOIN_S) -> None:
        self.kept: list[Interval] = []
        self.more = 0
        self.seconds = 0.0
        self.count = 0
        self._most, self._join = most, join
        self._last: Interval | None = None

    def add(self, start: float, end: float, size: float = 0.0) -> None:
        """Take the next, seconds, and its size."""
        self.count += 1
        last = self._last
        if last is not None and start - last.end <= self._join:
            self.seconds += max(end - last.end, 0.0)
            last.end, last.count = max(end, last.end), last.count + 1
            last.low, last.high = min(size, last.low), max(size, last.high)
            return
        self._last = Interval(start, end, size, size)
        self.seconds += end - start
        if len(self.kept) < self._most:
            self.kept.append(self._last)
        else:
            self.more += 1
