"""Messages on their way: some come late, some never. Knows no ROS; time is an argument."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from typing import Any

from sim_bridge.faults.schedule import FaultSchedule


class Outbox:
    """Hands messages on when they are due, as the faults that hold let it.

    Args:
        faults: what becomes of each message.

    On one topic no message overtakes another.
    """

    def __init__(self, faults: FaultSchedule) -> None:
        self._faults = faults
        self._waiting: list[tuple[float, int, Callable[[Any], object], Any]] = []
        self._last_due: dict[str, float] = {}
        self._count = 0

    def put(
        self,
        topic: str,
        message: Any,
        send: Callable[[Any], object],
        t: float,
        latency: float = 0.0,
    ) -> None:
        """Take a message; ``release`` sends it.

        Args:
            topic: its topic, for the faults.
            message: what to send.
            send: takes the message when it is due.
            t: simulated time, s.
            latency: s that it is under way without any fault.
        """
        message, delay = self._faults.pass_on(topic, message, t)
        if message is None:
            return
        due = max(t + latency + delay, self._last_due.get(topic, 0.0))
        self._last_due[topic] = due
        self._count += 1
        heapq.heappush(self._waiting, (due, self._count, send, message))

    def due(self, t: float) -> bool:
        """Whether a message is to be sent at time t, s."""
        return bool(self._waiting) and self._waiting[0][0] <= t + 1e-9

    def release(self, t: float) -> None:
        """Send what is due at time t, s, in the order of the times it is due."""
        while self.due(t):
            _, _, send, message = heapq.heappop(self._waiting)
            send(message)

    def clear(self) -> None:
        """Forget everything under way."""
        self._waiting.clear()
        self._last_due.clear()
