"""Messages in the order of their arrival, though a busy process takes them otherwise. Pure."""

from __future__ import annotations

import heapq
import itertools
from collections import deque
from collections.abc import Iterator
from typing import Generic, TypeVar

T = TypeVar("T")

HOLD_NS = 500_000_000
"""Real time for which a message is held back, as one that arrived before it may be taken later. An
executor takes one message of each topic in turn, far more often than this."""


class ArrivalOrder(Generic[T]):
    """Holds what was taken back until nothing that arrived before it can wait any more.

    The earliest arrival among the messages taken within ``HOLD_NS`` tells how far behind the
    process is: nothing older waits anywhere.
    """

    def __init__(self) -> None:
        self._held: list[tuple[int, int, T]] = []
        self._count = itertools.count()
        self._earliest: deque[tuple[int, int]] = deque()

    def take(self, arrived_ns: int, item: T, now_ns: int) -> Iterator[tuple[int, T]]:
        """Take a message.

        Args:
            arrived_ns: when it arrived, on any clock.
            item: the message.
            now_ns: monotonic time.

        Yields:
            Times of arrival and messages that are due now, in their order.
        """
        heapq.heappush(self._held, (arrived_ns, next(self._count), item))
        earliest = self._earliest
        while earliest and earliest[-1][1] >= arrived_ns:
            earliest.pop()
        earliest.append((now_ns, arrived_ns))
        while earliest[0][0] < now_ns - HOLD_NS:
            earliest.popleft()
        while self._held and self._held[0][0] < earliest[0][1]:
            yield self._next()

    def rest(self) -> Iterator[tuple[int, T]]:
        """What is still held, in its order; nothing more will be taken."""
        while self._held:
            yield self._next()

    def _next(self) -> tuple[int, T]:
        arrived_ns, _, item = heapq.heappop(self._held)
        return arrived_ns, item
