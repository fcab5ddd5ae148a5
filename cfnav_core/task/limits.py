"""Where an episode is cut, and from where on the LiDAR forbids a move: offline and on a robot."""

from __future__ import annotations

STEP_LIMIT = 100
LIVING_ROOM_STEP_LIMIT = 200

VETO_PROBABILITY = 0.5
"""Collision probability from which the LiDAR's veto forbids a MoveAhead."""


def step_limit(room_type: str) -> int:
    """Most actions of an episode, Done included: 100, 200 in living rooms, as the lineage tests."""
    return LIVING_ROOM_STEP_LIMIT if room_type == "living_room" else STEP_LIMIT
