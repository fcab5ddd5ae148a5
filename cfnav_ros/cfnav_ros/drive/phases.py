"""Where an episode stands, and what it gives at each moment. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from cfnav_ros.drive.motion import STOP, Command

if TYPE_CHECKING:
    from cfnav_core.policy.policy import Decision


class Phase(Enum):
    """Where an episode stands."""

    PREFLIGHT = "preflight"
    UNDOCK = "undock"
    OBSERVE = "observe"
    THINK = "think"
    MOVE = "move"
    TILT = "tilt"
    STOPPING = "stopping"
    DOCK = "dock"
    ENDED = "ended"


NOT_DRIVEN = (Phase.PREFLIGHT, Phase.UNDOCK)
"""Before the drive: what ends an episode here is a refusal."""

DOCKS_AFTER = ("done", "step_limit", "time_limit")
"""Outcomes of a drive that nothing and nobody broke off."""


@dataclass(frozen=True)
class StepRecord:
    """One decision of an episode, made but not yet executed.

    Attributes:
        met_before: whether a MoveAhead of this drive was stopped by something in this way ahead.
    """

    step: int
    decision: Decision
    image_stamp_ns: int
    estimate_stamp_ns: int
    vetoed: bool
    met_before: bool = False


@dataclass(frozen=True)
class Output:
    """What to do now: a velocity always; a tilt to command and a decision to publish if any."""

    command: Command = STOP
    tilt: float | None = None
    record: StepRecord | None = None
