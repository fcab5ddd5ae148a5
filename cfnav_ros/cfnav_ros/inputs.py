"""What an episode knows of the robot at one moment, and when that is too old to act on.

Pure. Stamps are node time; those that go into records are integer nanoseconds, ages are seconds.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from cfnav_ros.lidar import Estimate, blind
from cfnav_ros.motion import Odometry
from cfnav_ros.preflight import BaseCheck

FUTURE_S = 0.5
"""A stamp this far ahead of node time comes from another clock."""


NEVER, NEVER_NS = -math.inf, -1
"""Stamps of what has not arrived yet."""


def seconds(stamp_ns: int) -> float:
    """A stamp in seconds."""
    return NEVER if stamp_ns == NEVER_NS else stamp_ns * 1e-9


def _no_picture() -> np.ndarray:
    raise ValueError("No picture has arrived.")


@dataclass(frozen=True)
class Frame:
    """A picture; ``decode`` gives uint8 [H, W, 3] RGB or raises ValueError with one sentence."""

    stamp_ns: int = NEVER_NS
    decode: Callable[[], np.ndarray] = _no_picture


@dataclass(frozen=True)
class StampedEstimate:
    """A collision estimate and the stamp of the scan it came from."""

    stamp_ns: int = NEVER_NS
    estimate: Estimate = field(default_factory=lambda: blind("No estimate has arrived."))


@dataclass(frozen=True)
class Tilt:
    """Measured camera tilt, radians, up positive; stamp in seconds."""

    stamp: float = NEVER
    angle: float = math.nan


@dataclass(frozen=True)
class Inputs:
    """The newest message of each kind; stamped ``NEVER`` until the first."""

    base: BaseCheck = BaseCheck(waiting="Nobody has looked for a robot yet.")  # noqa: RUF009
    frame: Frame = field(default_factory=Frame)
    estimate: StampedEstimate = field(default_factory=StampedEstimate)
    odometry: Odometry = field(default_factory=lambda: Odometry(NEVER, 0.0, 0.0, 0.0))
    tilt: Tilt = field(default_factory=Tilt)
    bumped_at: float = NEVER


@dataclass(frozen=True)
class AgeLimits:
    """Oldest input to act on, seconds of node time: about five periods of each."""

    frame: float = field(default=1.0, metadata={"help": "picture, s"})
    estimate: float = field(default=0.5, metadata={"help": "collision estimate, s"})
    odometry: float = field(default=0.25, metadata={"help": "odometry, s"})
    tilt: float = field(default=0.5, metadata={"help": "measured camera tilt, s"})


def unusable(
    t: float, inputs: Inputs, limits: AgeLimits, lidar: bool = True, tilt: bool = True
) -> str:
    """Name the inputs that are missing or too old.

    Args:
        t: node time, seconds.
        inputs: newest messages.
        limits: oldest allowed.
        lidar: whether the collision estimate is needed.
        tilt: whether the camera tilt is needed.

    Returns:
        One sentence, empty when all can be used.
    """
    stamps = {
        "picture": (seconds(inputs.frame.stamp_ns), limits.frame),
        "odometry": (inputs.odometry.stamp, limits.odometry),
    }
    if lidar:
        stamps["collision estimate"] = (seconds(inputs.estimate.stamp_ns), limits.estimate)
    if tilt:
        stamps["camera tilt"] = (inputs.tilt.stamp, limits.tilt)
    complaints = []
    for name, (stamp, limit) in stamps.items():
        if stamp == NEVER:
            complaints.append(f"no {name} has arrived")
        elif t - stamp > limit:
            complaints.append(f"the newest {name} is {t - stamp:.2f} s old (limit {limit:g} s)")
        elif stamp - t > FUTURE_S:
            complaints.append(f"the {name} is stamped {stamp - t:.1f} s in the future")
    text = "; ".join(complaints)
    return f"{text[0].upper()}{text[1:]}." if text else ""
