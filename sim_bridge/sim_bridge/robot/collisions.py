"""Contacts of successive steps, counted as collisions. Pure: time is an argument."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim_bridge.world.world import Touch

COLLISION_GAP_S = 0.5
"""Contacts less than this apart are one collision, s."""


class Collisions:
    """Counts collisions in the contacts of successive steps."""

    def __init__(self) -> None:
        self.count = 0
        self.contacts: tuple[Touch, ...] = ()
        """What touches at present."""
        self.impact_speed = 0.0
        """m/s at the onset of the present collision; 0 when nothing touches."""
        self._last_touch = -math.inf

    def update(self, t: float, contacts: Sequence[Touch], speed: float) -> bool:
        """Take the contacts after one step.

        Args:
            t: time, s.
            contacts: whatever touches hull or mast.
            speed: m/s of the robot before the step; at its end the impact has slowed it.

        Returns:
            Whether a new collision began.
        """
        self.contacts = tuple(contacts)
        if not contacts:
            self.impact_speed = 0.0
            return False
        began = t - self._last_touch >= COLLISION_GAP_S - 1e-9
        self._last_touch = t
        if began:
            self.count += 1
            self.impact_speed = speed
        return began
