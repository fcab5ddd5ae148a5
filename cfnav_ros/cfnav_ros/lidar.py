"""Would MoveAhead collide? One planar scan -> clearance, probability and a verdict.

Pure: knows no ROS and no clock. A scan that cannot be judged is never free space: it is BLIND and
its collision probability is 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from cfnav_core.actions import STEP_M


class Verdict(IntEnum):
    """Quality of one estimate; the values are those of cfnav_interfaces/CollisionEstimate."""

    GOOD = 0
    DEGRADED = 1
    BLIND = 2


@dataclass(frozen=True)
class Scan:
    """One turn of a planar laser scanner, in the fields and units of sensor_msgs/LaserScan.

    ``ranges`` is float32 [N], metres; beam i looks along ``angle_min + i * angle_increment``,
    radians counter-clockwise in the scanner's frame.
    """

    ranges: np.ndarray
    angle_min: float
    angle_max: float
    angle_increment: float
    range_min: float
    range_max: float


@dataclass(frozen=True)
class Estimate:
    """What one scan says about the next MoveAhead.

    ``clearance`` is how far the footprint can advance before contact, metres, at most the
    scanner's range and 0 when blind. ``known_fraction`` is the share of forward beams with a usable
    return. ``reason`` is one sentence unless the verdict is GOOD.
    """

    probability: float
    clearance: float
    verdict: Verdict
    reason: str
    known_fraction: float


@dataclass(frozen=True)
class SweptDisc:
    """Geometry and thresholds of the estimate; lengths in metres, angles in degrees.

    Sources: the mounting is the TurtleBot 4's URDF, the radius Nav2's ``robot_radius`` for it and
    the hull of the built-in rooms. ``margin`` covers 1 % range noise at half a metre and a degree
    of heading error over one step; ``bias`` is the motion's end tolerance; ``scale`` is a starting
    value for range noise and odometry together, until fitted on recorded contacts. An unknown arc
    of ``blind_arc_deg`` hides something 0.25 m wide at the hull's reach after one step.
    """

    mount_x: float = field(default=-0.04, metadata={"help": "LiDAR in base_link, forward, m"})
    mount_y: float = field(default=0.0, metadata={"help": "LiDAR in base_link, left, m"})
    mount_yaw_deg: float = field(default=90.0, metadata={"help": "LiDAR x-axis in base_link, deg"})
    radius: float = field(default=0.175, metadata={"help": "hull of the robot, m"})
    margin: float = field(default=0.01, metadata={"help": "added to the radius, m"})
    step: float = field(default=STEP_M, metadata={"help": "length of MoveAhead, m"})
    bias: float = field(default=0.01, metadata={"help": "clearance beyond the step at p = 0.5, m"})
    scale: float = field(default=0.03, metadata={"help": "width of the logistic, m"})
    sector_deg: float = field(default=60.0, metadata={"help": "half-width judged for quality"})
    min_known: float = field(default=0.4, metadata={"help": "less known of the sector is BLIND"})
    good_known: float = field(default=0.8, metadata={"help": "less known is DEGRADED"})
    blind_arc_deg: float = field(default=30.0, metadata={"help": "longest unknown arc: BLIND"})
    good_arc_deg: float = field(default=10.0, metadata={"help": "longest unknown arc: DEGRADED"})
    min_returns: int = field(default=8, metadata={"help": "fewest distinct forward returns"})
    mask_bearings_deg: str = field(
        default="58.3 -58.3 111.7 -111.7 180",
        metadata={"help": "bearings of the robot's own parts seen by the LiDAR"},
    )
    mask_half_width_deg: float = field(default=4.0, metadata={"help": "half-width of each"})

    def __post_init__(self) -> None:
        for name in ("radius", "step", "scale", "sector_deg"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} is {getattr(self, name)}, expected a positive number.")
        _ = self.mask_bearings

    @property
    def mask_bearings(self) -> np.ndarray:
        """float64 [M], radians, where the LiDAR sees the robot itself."""
        try:
            return np.radians([float(word) for word in self.mask_bearings_deg.split()])
        except ValueError:
            raise ValueError(
                f"mask_bearings_deg is {self.mask_bearings_deg!r}, expected numbers separated by "
                "spaces."
            ) from None


def collision_probability(clearance: float, disc: SweptDisc) -> float:
    """Probability that a MoveAhead with this clearance (metres) ends in a contact: a logistic."""
    return 1.0 / (1.0 + math.exp(min((clearance - disc.step - disc.bias) / disc.scale, 700.0)))


def clearance(points: np.ndarray, disc: SweptDisc, limit: float) -> float:
    """How far the disc can advance along x before it touches a point.

    Args:
        points: float [N, 2], metres, in base_link.
        disc: geometry.
        limit: metres, the answer when nothing stands in the way.

    Returns:
        Metres in [0, limit].
    """
    radius = disc.radius + disc.margin
    x, y = points[:, 0], points[:, 1]
    # A point behind the centre is only left further behind.
    ahead = (x > 0) & (np.abs(y) < radius)
    if not ahead.any():
        return limit
    travel = x[ahead] - np.sqrt(radius**2 - y[ahead] ** 2)
    return float(np.clip(travel.min(), 0.0, limit))


def distinct_returns(ranges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Merge runs of equal values: the A1 driver copies each return into several beams.

    Args:
        ranges: float [N].

    Returns:
        (float [M] fractional index of each run's centre, float [M] its value).
    """
    starts = np.flatnonzero(np.r_[True, ranges[1:] != ranges[:-1]])
    ends = np.r_[starts[1:], len(ranges)] - 1
    return (starts + ends) / 2.0, ranges[starts]


def estimate_collision(scan: Scan, disc: SweptDisc = SweptDisc()) -> Estimate:
    """Judge the next MoveAhead from one scan.

    Args:
        scan: any content; a malformed one gives BLIND, never an exception.
        disc: geometry and thresholds.

    Returns:
        The estimate. A return closer than the scanner's minimum counts as an obstacle there, +inf
        and NaN as unknown (this scanner answers +inf for dark, glass and too close alike).

    Source: REP-117 for the meaning of values; the swept disc and the logistic are ours, the paper
    gives no formula.
    """
    fault = _malformed(scan)
    if fault:
        return blind(fault)
    ranges = np.asarray(scan.ranges, np.float64)
    index, value = distinct_returns(ranges)
    index, value = index[_usable(value, scan)], value[_usable(value, scan)]
    bearing = _bearings(index, scan, disc)
    masked = _masked(bearing, disc) & (value < scan.range_min)
    bearing, value = bearing[~masked], value[~masked]

    known, arc = _forward_quality(ranges, scan, disc)
    forward = int((np.abs(bearing) <= math.radians(disc.sector_deg)).sum())
    fault = _too_little(known, arc, forward, disc)
    if fault:
        return blind(fault, known)

    value = np.where(value == -np.inf, scan.range_min, value)
    x = disc.mount_x + value * np.cos(bearing)
    y = disc.mount_y + value * np.sin(bearing)
    free = clearance(np.stack([x, y], axis=1), disc, scan.range_max)
    probability = max(collision_probability(free, disc), _unknown_probability(arc, disc))
    if known >= disc.good_known and arc <= disc.good_arc_deg:
        return Estimate(probability, free, Verdict.GOOD, "", known)
    reason = (
        f"{known:.0%} of the forward beams return, the longest unknown arc is {arc:.0f} degrees."
    )
    return Estimate(probability, free, Verdict.DEGRADED, reason, known)


def _malformed(scan: Scan) -> str:
    count = np.asarray(scan.ranges).size
    if count < 2:
        return f"The scan holds {count} ranges, expected at least 2."
    numbers = (scan.angle_min, scan.angle_max, scan.angle_increment, scan.range_min, scan.range_max)
    if not all(map(math.isfinite, numbers)):
        return "The scan's angles or range limits are not finite."
    if not 0 <= scan.range_min < scan.range_max:
        return f"range_min {scan.range_min:g} and range_max {scan.range_max:g} are no interval."
    if scan.angle_increment == 0:
        return "angle_increment is 0."
    span = scan.angle_min + (count - 1) * scan.angle_increment
    if abs(span - scan.angle_max) >= 2 * abs(scan.angle_increment):
        return (
            f"{count} ranges end at {span:.3f} rad, but the scan says angle_max "
            f"{scan.angle_max:.3f}."
        )
    return ""


def _usable(ranges: np.ndarray, scan: Scan) -> np.ndarray:
    """Beams that met something: within range, nearer than range_min, or -inf ("too close")."""
    # Written so that NaN fails; 0 and finite negatives are the driver's "nothing".
    return ((ranges > 0) & (ranges <= scan.range_max)) | (ranges == -np.inf)


def _bearings(index: np.ndarray, scan: Scan, disc: SweptDisc) -> np.ndarray:
    """Bearing of beams in base_link, radians in [-pi, pi)."""
    angle = scan.angle_min + index * scan.angle_increment + math.radians(disc.mount_yaw_deg)
    return (angle + math.pi) % (2 * math.pi) - math.pi


def _masked(bearing: np.ndarray, disc: SweptDisc) -> np.ndarray:
    offset = bearing[:, None] - disc.mask_bearings[None, :]
    offset = np.abs((offset + math.pi) % (2 * math.pi) - math.pi)
    return (offset <= math.radians(disc.mask_half_width_deg)).any(axis=1)


def _forward_quality(ranges: np.ndarray, scan: Scan, disc: SweptDisc) -> tuple[float, float]:
    """Share of forward beams with a return, and the longest arc without one (degrees).

    The robot's own parts are left out of the share and do not lengthen an arc. A scan that does not
    reach around the whole sector leaves the rest of it unknown.
    """
    half, width = math.radians(disc.sector_deg), abs(scan.angle_increment)
    bearing = _bearings(np.arange(ranges.size), scan, disc)
    inside = np.abs(bearing) <= half
    masked = _masked(bearing, disc) & inside
    usable = _usable(ranges, scan) & inside
    beams = max(round(2 * half / width), 1) - int(masked.sum())
    known = min(int((usable & ~masked).sum()) / max(beams, 1), 1.0)
    seen = np.sort(np.r_[-half, bearing[usable | masked], half])
    arc = max(float(np.diff(seen).max()) - width, 0.0)
    return known, math.degrees(arc)


def _too_little(known: float, arc: float, returns: int, disc: SweptDisc) -> str:
    if known < disc.min_known:
        return f"{known:.0%} of the forward beams return, expected at least {disc.min_known:.0%}."
    if returns < disc.min_returns:
        return f"{returns} distinct forward returns, expected at least {disc.min_returns}."
    if arc > disc.blind_arc_deg:
        return f"{arc:.0f} degrees of the forward sector in one piece return nothing."
    return ""


def _unknown_probability(arc: float, disc: SweptDisc) -> float:
    """Rises from 0 at the longest arc that is still good to 1 where the scan becomes blind."""
    return min(max((arc - disc.good_arc_deg) / (disc.blind_arc_deg - disc.good_arc_deg), 0.0), 1.0)


def blind(reason: str, known: float = 0.0) -> Estimate:
    """The estimate of who sees nothing: a collision is certain."""
    return Estimate(1.0, 0.0, Verdict.BLIND, reason, known)
