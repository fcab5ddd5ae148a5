"""Stamps of messages: what they mean before any has arrived, and beside another clock."""

from __future__ import annotations

import math

FUTURE_S = 0.5
"""A stamp this far ahead of node time comes from another clock."""


OTHER_TIME_S = 1e8
"""Clocks further apart (three years) read simulated time and the system's."""

NEVER, NEVER_NS = -math.inf, -1
"""Stamps of what has not arrived yet."""


def seconds(stamp_ns: int) -> float:
    """A stamp in seconds."""
    return NEVER if stamp_ns == NEVER_NS else stamp_ns * 1e-9
