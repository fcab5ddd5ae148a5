"""The discrete action space of the paper (Section III), in the field's index order."""

from __future__ import annotations

import math
from enum import IntEnum

STEP_M = 0.25
"""Length of ``MoveAhead`` on a robot, metres; sqrt(2) longer on diagonals of the state grid."""

TURN_RAD = math.radians(45.0)
"""Turn of ``RotateLeft`` (+) and ``RotateRight`` (-), radians, counter-clockwise positive."""


class Action(IntEnum):
    """One motion of the agent; the value is its index in every policy output.

    ``LookUp`` at the level tilt and ``LookDown`` at the lowest change nothing and are no collision.
    Only ``MoveAhead`` can collide. ``Done`` ends the episode.
    """

    MoveAhead = 0
    RotateLeft = 1
    RotateRight = 2
    LookUp = 3
    LookDown = 4
    Done = 5


NUM_ACTIONS = len(Action)
