"""Stalls in odometry with noise, by its means over blocks, and what cannot be seen. Pure."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import NamedTuple

from cfnav_ros.bags.files.events import Pose, Velocity
from cfnav_ros.bags.judge.contacts import Contact, Whereabouts
from cfnav_ros.bags.judge.odometry import TOO_FEW, Blocks, OdometryQuality
from cfnav_ros.bags.judge.stalls import LEAST, MOST_COMMANDS, SLACK, StallContacts
from cfnav_ros.drive.motion import STALL_M, MotionLimits

VISIBLE_S = MotionLimits().stall_time - STALL_M / MotionLimits().v_max
"""So long the executor pushes on after an impact at full speed: it gives up ``stall_time`` after
its last ``STALL_M`` of way. What shows longer stalls only may miss it."""


class BlockStalls:
    """``StallContacts`` over means of the odometry: each command is told at its time among them."""

    def __init__(self, block_s: float) -> None:
        """Know nothing yet; ``block_s``: of a block, seconds."""
        self._blocks, self._stalls = Blocks(block_s), StallContacts(block_s)
        self._block_s = block_s
        self._commands: deque[tuple[int, Velocity]] = deque(maxlen=MOST_COMMANDS)

    @property
    def slow_commands_s(self) -> float:
        """See ``StallContacts``."""
        return self._stalls.slow_commands_s

    def told(self, t_ns: int, velocity: Velocity) -> None:
        """Take the next command."""
        self._commands.append((t_ns, velocity))

    def moved(self, t_ns: int, pose: Pose, where: Whereabouts) -> Contact | None:
        """Take the next odometry; a contact when the block that it ends shows one."""
        mean = self._blocks.take(t_ns, pose)
        if mean is None:
            return None
        while self._commands and self._commands[0][0] <= mean[0]:
            self._stalls.told(*self._commands.popleft())
        found = self._stalls.moved(*mean, where)
        return replace(found, block_s=self._block_s) if found else None


class Sight(NamedTuple):
    """Which stalls can be seen.

    Attributes:
        unseen: those that cannot; part of a sentence, empty where every stall is seen that lasts
            as long as the executor's.
        blind: whether none can, and what seems to be one is none.
    """

    unseen: str = ""
    blind: bool = False


def sight(quality: OdometryQuality, slow_commands_s: float) -> Sight:
    """What can be seen by commands and odometry like these.

    Args:
        quality: of the odometry.
        slow_commands_s: time between two commands, seconds, where the base forgets them before.
    """
    if slow_commands_s:
        return Sight(
            f"commands come every {slow_commands_s:.1f} s, and the base forgets each before the "
            "next: what stops it between cannot be told"
        )
    spacing = quality.spacing
    if LEAST * quality.longest_spacing <= SLACK * VISIBLE_S:
        return Sight()
    if quality.longest_spacing > spacing:
        return Sight(TOO_FEW, True)
    jitter = f"{1000 * quality.jitter_m:.1f} mm, {math.degrees(quality.jitter_rad):.1f} degrees"
    shows = "no stall" if math.isinf(spacing) else f"only stalls of {LEAST * spacing:.1f} s or more"
    return Sight(
        f"odometry every {quality.period:.2f} s that jitters by {jitter} shows {shows}",
        math.isinf(spacing),
    )
