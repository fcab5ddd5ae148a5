"""Would MoveAhead collide? One planar scan -> clearance, probability and a verdict.

Pure: knows no ROS and no clock. A scan that cannot be judged is never free space: it is BLIND and
its collision probability is 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import lru_cache

import numpy as np

from cfnav_core.robot.settings import setting
from cfnav_core.task.actions import STEP_M
from cfnav_ros.lidar.returns import Beams, Mount, Scan, ScanView, look, malformed, wrap
from cfnav_ros.lidar.sweep import (
    NOMINAL,
    ErrorModel,
    free_way,
    hidden_probability,
    seen_probability,
)


class Verdict(IntEnum):
    """Quality of one estimate; the values are those of cfnav_interfaces/CollisionEstimate."""

    GOOD = 0
    DEGRADED = 1
    BLIND = 2


@dataclass(frozen=True)
class OtherMotion:
    """What one scan says about a motion other than MoveAhead.

    ``clearance``, metres: of a turn from the footprint to the nearest return, of MoveBack how far
    the footprint can back off.
    """

    motion: str
    probability: float
    clearance: float
    verdict: Verdict


OTHERS = ("RotateLeft", "RotateRight", "MoveBack")


@dataclass(frozen=True)
class Estimate:
    """What one scan says about the next MoveAhead.

    ``clearance`` is how far the footprint can advance and stay ``margin`` before contact, metres,
    at most the scanner's range and 0 when blind. ``known_fraction`` is the share of forward beams
    with a usable return. ``reason`` says what is wrong unless the verdict is GOOD, and what depth
    adds. ``unknown_arc`` is
    the longest forward arc without a return, degrees. ``others`` judges the motions of ``OTHERS``.
    """

    probability: float
    clearance: float
    verdict: Verdict
    reason: str
    known_fraction: float
    unknown_arc: float = 0.0
    others: tuple[OtherMotion, ...] = ()


@dataclass(frozen=True)
class SweptDisc:
    """Geometry and thresholds of the estimate; lengths in metres, angles in degrees.

    Sources: the mounting is the TurtleBot 4's URDF, the radius Nav2's ``robot_radius`` for it and
    the hull of the built-in rooms. ``margin`` is kept ahead by the published clearance, which
    guards a motion under way; it makes the hull no wider, so that what the probability lets pass
    aside does not stop the motion later. An unknown arc of ``blind_arc_deg`` hides something 0.2 m
    wide at the hull's reach after one step. Tower posts (radius 6 mm) and camera bracket stand at
    the bearings of ``mask_bearings_deg`` (turtlebot4_description); what returns there from within
    ``radius`` is the robot itself.
    """

    mount_x: float = setting(-0.04, "LiDAR in base_link, forward, m", -0.5, 0.5)
    mount_y: float = setting(0.0, "LiDAR in base_link, left, m", -0.5, 0.5)
    mount_yaw_deg: float = setting(90.0, "LiDAR x-axis in base_link, deg", -360.0, 360.0)
    radius: float = setting(0.175, "hull of the robot, m", 0.01, 1.0)
    margin: float = setting(0.01, "kept ahead by the clearance, m", 0.0, 0.5)
    step: float = setting(STEP_M, "length of MoveAhead, m", 0.01, 2.0)
    sector_deg: float = setting(60.0, "half-width judged for quality", 5.0, 180.0)
    min_known: float = setting(0.4, "less known of the sector is BLIND", 0.0, 1.0)
    good_known: float = setting(0.8, "less known is DEGRADED", 0.0, 1.0)
    blind_arc_deg: float = setting(25.0, "longer unknown arc: BLIND", 1.0, 360.0)
    good_arc_deg: float = setting(10.0, "longer unknown arc: DEGRADED", 0.0, 360.0)
    min_returns: int = setting(8, "fewest distinct forward returns", 1, 1000)
    mask_bearings_deg: str = setting(
        "58.3 -58.3 111.7 -111.7 180", "bearings of the robot's own parts seen by the LiDAR"
    )
    mask_half_width_deg: float = setting(4.0, "half-width of each, deg", 0.0, 45.0)

    def __post_init__(self) -> None:
        _ = self.mask_bearings  # refuses what is no list of numbers

    @property
    def mask_bearings(self) -> tuple[float, ...]:
        """Where the LiDAR sees the robot itself, radians."""
        try:
            return tuple(math.radians(float(word)) for word in self.mask_bearings_deg.split())
        except ValueError:
            raise ValueError(
                f"mask_bearings_deg is {self.mask_bearings_deg!r}, expected numbers separated by "
                "spaces."
            ) from None

    @property
    def mount(self) -> Mount:
        """The mounting that these fields say."""
        return Mount(self.mount_x, self.mount_y, math.radians(self.mount_yaw_deg))


def estimate_collision(
    scan: Scan,
    disc: SweptDisc = SweptDisc(),
    errors: ErrorModel = NOMINAL,
    mount: Mount | None = None,
    before: np.ndarray | None = None,
) -> Estimate:
    """Judge the next MoveAhead, and the motions of ``OTHERS``, from one scan.

    Args:
        scan: any content; a malformed one gives BLIND, never an exception.
        disc: geometry and thresholds.
        errors: the error model; it states the formula of the probability.
        mount: of the scanner, that of ``disc`` when None.
        before: ranges of the scan before, float32 [N], which a lone near return must be in.

    Returns:
        The estimate. A return closer than the scanner's minimum counts as an obstacle there, +inf
        and NaN as unknown (this scanner answers +inf for dark, glass and too close alike).

    Source: REP-117 for the meaning of values; the swept disc and its error model are ours.
    """
    fault = malformed(scan)
    if fault:
        return blind(fault)
    half_width = math.radians(disc.mask_half_width_deg)
    where = (mount or disc.mount).corrected(math.radians(errors.bearing_bias_deg))
    view = look(scan, where, disc.mask_bearings, half_width, disc.radius, before)
    turn = _turn(view, disc, errors)
    others = (*(replace(turn, motion=name) for name in OTHERS[:2]), _back(view, scan, disc, errors))
    known, arc, returns = _quality(view, False, disc.sector_deg)
    fault = _too_little(known, arc, returns, disc)
    if fault:
        return replace(blind(fault, known), unknown_arc=arc, others=others)
    probability, clearance = _sweep(view, False, disc, errors, scan.range_max)
    verdict = _verdict(known, arc, disc)
    reason = ""
    if verdict is not Verdict.GOOD:
        reason = (
            f"{known:.0%} of the forward beams return, the longest unknown arc is {arc:.0f} "
            "degrees."
        )
    elif view.ghosts:
        verdict = Verdict.DEGRADED
        reason = f"{view.ghosts} lone near returns are left out: the scan before had them not."
    return Estimate(probability, clearance, verdict, reason, known, arc, others)


def blind(reason: str, known: float = 0.0) -> Estimate:
    """The estimate of who sees nothing: a collision is certain, whatever the motion."""
    others = tuple(OtherMotion(motion, 1.0, 0.0, Verdict.BLIND) for motion in OTHERS)
    return Estimate(1.0, 0.0, Verdict.BLIND, reason, known, 360.0, others)


def _sweep(
    view: ScanView, back: bool, disc: SweptDisc, errors: ErrorModel, limit: float
) -> tuple[float, float]:
    """Probability and clearance (at most ``limit``, metres) of one step forward or back."""
    sign = -1.0 if back else 1.0
    turned, scanner = sign * view.points, (sign * view.mount.x, sign * view.mount.y)
    of_points = errors.of_range(view.ranges)
    seen = seen_probability(turned, of_points, disc.radius, disc.step, errors)
    gaps = _arcs(view.unknown, back, math.pi / 2)
    hidden = hidden_probability(gaps, scanner, disc.radius, disc.step, errors)
    beside = free_way(turned, disc.radius + errors.overhang_aside).min(initial=limit)
    unseen = errors.unseen_near if beside < disc.step + errors.overhang else errors.unseen
    clearance = free_way(turned, disc.radius).min(initial=limit) - disc.margin
    return 1.0 - (1.0 - seen) * (1.0 - hidden) * (1.0 - unseen), max(float(clearance), 0.0)


def _turn(view: ScanView, disc: SweptDisc, errors: ErrorModel) -> OtherMotion:
    """Judge a turn in place, to either side.

    A disc that turns in place sweeps nothing but its own footprint, so a turn touches only what
    stands nearer than its centre strays. What hides in the strip under the scanner's minimum
    behind the robot is not touched either; beams without a return there make the verdict DEGRADED.
    """
    distance = np.hypot(view.points[:, 0], view.points[:, 1]).min(initial=np.inf)
    clearance = max(float(distance) - disc.radius, 0.0)
    probability = 1.0 - math.erf(clearance / (errors.end * math.sqrt(2)))
    known, arc, _ = _quality(view, False, 180.0)
    verdict = _verdict(known, arc, disc)
    clearance = 0.0 if verdict is Verdict.BLIND else clearance
    return OtherMotion("", 1.0 if verdict is Verdict.BLIND else probability, clearance, verdict)


def _back(view: ScanView, scan: Scan, disc: SweptDisc, errors: ErrorModel) -> OtherMotion:
    """Judge one step backwards.

    Posts and bracket hide arcs there, and what touches the rear half of the hull stands nearer
    than the scanner measures and returns nothing: both count as unknown arcs do. While one of the
    robot's own parts stands in the swept half, the verdict is never GOOD.
    """
    known, arc, returns = _quality(view, True, disc.sector_deg)
    verdict = _verdict(known, arc, disc)
    if verdict is Verdict.BLIND or returns < disc.min_returns:
        return OtherMotion(OTHERS[2], 1.0, 0.0, Verdict.BLIND)
    probability, clearance = _sweep(view, True, disc, errors, scan.range_max)
    if _sector(view.beams, True, math.radians(disc.sector_deg))[1]:
        verdict = Verdict.DEGRADED
    return OtherMotion(OTHERS[2], probability, clearance, verdict)


def _quality(view: ScanView, back: bool, half_deg: float) -> tuple[float, float, int]:
    """Share of known beams ahead or behind, longest arc without one (degrees), distinct returns.

    The robot's own parts are left out of the share and do not lengthen an arc. A scan that does not
    reach around the whole sector leaves the rest of it unknown.
    """
    half = math.radians(half_deg)
    looking, masked = _sector(view.beams, back, half)
    beams = max(round(2 * half / view.beams.step) - masked, 1)
    known = min(np.count_nonzero(view.known & looking) / beams, 1.0)
    arcs = _arcs(view.unlooked, back, half)
    arc = float((arcs[:, 1] - arcs[:, 0]).max(initial=0.0))
    return known, math.degrees(arc), int(np.count_nonzero(_inside(view.returns, back, half)))


@lru_cache(maxsize=32)
def _sector(beams: Beams, back: bool, half: float) -> tuple[np.ndarray, int]:
    """Beams in a sector: bool [N], those past the robot's own parts; the number of the others."""
    inside = _inside(beams.bearing, back, half)
    return inside & ~beams.masked, int(np.count_nonzero(inside & beams.masked))


def _inside(bearing: np.ndarray, back: bool, half: float) -> np.ndarray:
    """Which bearings (radians in [-pi, pi)) lie this near to the front, or to the back."""
    return np.abs(bearing) >= math.pi - half if back else np.abs(bearing) <= half


def _arcs(gaps: np.ndarray, back: bool, half: float) -> np.ndarray:
    """float64 [G, 2], begin and end, radians from front or back: the parts of gaps in a sector."""
    middle, width = gaps.T
    if back:
        middle = wrap(middle - math.pi)
    if half >= math.pi:  # all round: nothing to cut off
        return np.array((middle - width / 2, middle + width / 2)).T
    # A wide gap, and any in a wide sector, may reach into it from the other side too.
    if half > math.pi / 2 or width.max(initial=0.0) > math.pi:
        middle = np.concatenate([middle, middle - 2 * math.pi, middle + 2 * math.pi])
        width = np.tile(width, 3)
    begin, end = np.maximum(middle - width / 2, -half), np.minimum(middle + width / 2, half)
    return np.array((begin, end)).T[end > begin]


def _too_little(known: float, arc: float, returns: int, disc: SweptDisc) -> str:
    if known < disc.min_known:
        return (
            f"{known:.0%} of the forward beams return a range that the scanner measures, expected "
            f"at least {disc.min_known:.0%}."
        )
    if returns < disc.min_returns:
        return f"{returns} distinct forward returns, expected at least {disc.min_returns}."
    if arc > disc.blind_arc_deg:
        return f"{arc:.0f} degrees of the forward sector in one piece return nothing."
    return ""


def _verdict(known: float, arc: float, disc: SweptDisc) -> Verdict:
    if known < disc.min_known or arc > disc.blind_arc_deg:
        return Verdict.BLIND
    good = known >= disc.good_known and arc <= disc.good_arc_deg
    return Verdict.GOOD if good else Verdict.DEGRADED
