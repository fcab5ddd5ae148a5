"""What one planar scan holds: malformed fields, distinct returns, and where they stand.

Pure: numpy in, numpy out. A place is in base_link (x forward, y left, metres).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

MOST_RANGES = 20_000
"""More beams in a turn come from no planar scanner."""

SURFACE, SURFACE_LEAST = 0.1, 0.05
"""Neighbouring returns lie on one surface while their ranges differ by at most this share for each
degree between them: a wall seen at 80 degrees from its normal. The least is what the noise of a
poor scanner makes alone: 3.5 sigma of the difference where a range is off by 1 %."""

BRIDGE_DEG = 2.1
"""Returns further apart share no surface. Nearer ones may have bins between them that no sample
fell into (the A1 at 2 kHz), or one whose sample was lost."""

SMOOTH_DEG = 1.0
"""A range is the mean of its surface within this to each side. So a corner is cut by as much,
however many returns a turn has; with one a degree, it and its neighbours weigh 2 and 1."""

LONE_M, LONE_DEG = 0.3, 1.2
"""A single return nearer than this would be a thing narrower than 6 mm: rather a ghost of the
triangulation (laser_filters#105), unless the scan before had it too."""

AGAIN_M, AGAIN_DEG = 0.1, 3.5
"""It had it when it returned this near to the same place; the robot moves 0.03 m between scans."""

_BORDER = np.array([True])
"""Before the first return and after the last a surface ends."""


@dataclass(frozen=True)
class Scan:
    """One turn of a planar laser scanner, in the fields and units of sensor_msgs/LaserScan.

    ``ranges`` is float32 [N], metres; beam i looks along ``angle_min + i * angle_increment``,
    radians counter-clockwise in the scanner's frame ``frame``. ``scan_time`` is how long the turn
    took, seconds, 0 when the driver does not say.
    """

    ranges: np.ndarray
    angle_min: float
    angle_max: float
    angle_increment: float
    range_min: float
    range_max: float
    frame: str = ""
    scan_time: float = 0.0


@dataclass(frozen=True)
class Mount:
    """Where the scanner sits in base_link: metres, radians; hung upside down it turns clockwise."""

    x: float
    y: float
    yaw: float
    upside_down: bool = False

    def corrected(self, bias: float) -> Mount:
        """The same for a scanner whose angles are all announced this too large, radians."""
        return replace(self, yaw=self.yaw + (bias if self.upside_down else -bias))

    def bearings(self, angle: np.ndarray) -> np.ndarray:
        """Laser angles as bearings in base_link, radians in [-pi, pi)."""
        return wrap(self.yaw + (-angle if self.upside_down else angle))


@dataclass(frozen=True, eq=False)
class Beams:
    """Where a scanner's beams look from base_link; the arrays are not to be written to.

    Attributes:
        bearing: float64 [N], of every beam, radians in [-pi, pi).
        parts: bool [M, N], one row for each of the robot's own parts: the beam looks at it.
        masked: bool [N], the beam looks at any of them.
        hull: float64 [N], metres along the beam to where it leaves the robot's hull.
        step: radians between two beams.
    """

    bearing: np.ndarray
    parts: np.ndarray
    masked: np.ndarray
    hull: np.ndarray
    step: float


@dataclass(frozen=True)
class ScanView:
    """One scan seen from base_link.

    Attributes:
        mount: of the scanner.
        beams: where they look.
        known: bool [N], the beam met something at a range that the scanner measures.
        points: float64 [P, 2], metres, where something stands; the borders of surfaces included.
        ranges: float64 [P], metres from the scanner to each point.
        returns: float64 [R], bearing of each distinct return, radians.
        unknown: float64 [G, 2], arcs without a known beam: middle and width, radians.
        unlooked: float64 [H, 2], the same where the robot's own parts count as known.
        ghosts: lone near returns that were left out.
    """

    mount: Mount
    beams: Beams
    known: np.ndarray
    points: np.ndarray
    ranges: np.ndarray
    returns: np.ndarray
    unknown: np.ndarray
    unlooked: np.ndarray
    ghosts: int


def wrap(angle: np.ndarray) -> np.ndarray:
    """Angles in [-pi, pi), radians."""
    # Several times faster than the remainder.
    return angle - 2 * math.pi * np.floor((angle + math.pi) / (2 * math.pi))


def malformed(scan: Scan) -> str:
    """Say in one sentence what is wrong with a scan's fields; empty when nothing is."""
    count = np.asarray(scan.ranges).size
    if not 2 <= count <= MOST_RANGES:
        return f"The scan holds {count} ranges, expected 2 to {MOST_RANGES}."
    numbers = (scan.angle_min, scan.angle_max, scan.angle_increment, scan.range_min, scan.range_max)
    if not all(map(math.isfinite, numbers)):
        return "The scan's angles or range limits are not finite."
    if not 0 <= scan.range_min < scan.range_max:
        return f"range_min {scan.range_min:g} and range_max {scan.range_max:g} are no interval."
    step = abs(scan.angle_increment)
    if step == 0:
        return "angle_increment is 0."
    span = (count - 1) * scan.angle_increment
    if abs(scan.angle_min + span - scan.angle_max) >= 2 * step:
        return (
            f"{count} ranges end at {scan.angle_min + span:.3f} rad, but the scan says angle_max "
            f"{scan.angle_max:.3f}."
        )
    if abs(span) > 2 * math.pi + step:
        return f"The scan spans {math.degrees(abs(span)):.0f} degrees, expected at most a turn."
    return ""


def measured(ranges: np.ndarray, scan: Scan) -> np.ndarray:
    """Beams that met something at a range that the scanner measures: bool like ``ranges``."""
    # Written so that NaN fails. 0 and negative numbers are the driver's "nothing".
    return (ranges >= scan.range_min) & (ranges <= scan.range_max) & (ranges > 0)


def too_near(ranges: np.ndarray, scan: Scan) -> np.ndarray:
    """Beams that met something nearer than the scanner measures: bool like ``ranges``."""
    return ((ranges > 0) & (ranges < scan.range_min)) | (ranges == -np.inf)


def distinct_returns(ranges: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Merge runs of equal values: drivers may copy a return into several beams.

    The A1's does so where the next sample was lost or fell further away.

    Args:
        ranges: float [N].

    Returns:
        (int [M] first beam of each run, int [M] its last beam, float [M] its value).
    """
    (before,) = (ranges[1:] != ranges[:-1]).nonzero()
    first = np.concatenate(([0], before + 1))
    last = np.concatenate((before, [len(ranges) - 1]))
    return first, last, ranges[first]


@lru_cache(maxsize=8)
def beams(
    size: int,
    angle_min: float,
    step: float,
    mount: Mount,
    parts: tuple[float, ...],
    half: float,
    radius: float,
) -> Beams:
    """Where beams look; most scans have the same, so it is worked out once.

    Args:
        size: number of beams N.
        angle_min: of the first, radians.
        step: from each to the next, radians.
        mount: of the scanner.
        parts: bearings of the robot's own parts, radians.
        half: radians to each side of them.
        radius: of the hull around base_link, metres.
    """
    bearing = mount.bearings(angle_min + np.arange(size) * step)
    masks = np.abs(wrap(bearing[None, :] - np.reshape(parts, (-1, 1)))) <= half
    masked = np.logical_or.reduce(masks, axis=0)
    ahead, left = np.cos(bearing), np.sin(bearing)
    aside = mount.x * left - mount.y * ahead
    way_out = np.sqrt(np.maximum(radius**2 - aside**2, 0.0)) - mount.x * ahead - mount.y * left
    hull = np.where(np.abs(aside) < radius, way_out, 0.0)
    for shared in (bearing, masks, masked, hull):
        shared.flags.writeable = False
    return Beams(bearing, masks, masked, hull, abs(step))


def points_around(scan: Scan, mount: Mount, radius: float) -> np.ndarray:
    """The returns of a scan from beyond the robot's hull: float64 [N, 2], metres in base_link.

    Args:
        scan: its fields make sense (``malformed``).
        mount: of the scanner.
        radius: of the hull, metres.
    """
    ranges = np.asarray(scan.ranges, np.float64)
    there = beams(ranges.size, scan.angle_min, scan.angle_increment, mount, (), 0.0, radius)
    seen = measured(ranges, scan) & (ranges > there.hull)
    bearing, far = there.bearing[seen], ranges[seen]
    return np.column_stack([mount.x + far * np.cos(bearing), mount.y + far * np.sin(bearing)])


def look(
    scan: Scan,
    mount: Mount,
    parts: tuple[float, ...],
    half_width: float,
    radius: float,
    before: np.ndarray | None = None,
) -> ScanView:
    """See a well-formed scan from base_link.

    Nothing is taken for granted about how many beams a return fills: equal neighbours are one.
    Ranges are averaged along surfaces, as the nearest of many noisy returns is always too near. A
    surface reaches beyond its last return by half of the mean way to the next one: its border lies
    somewhere on it. Left out are lone returns close by that the scan before had not, and the
    robot's own parts: what returns from their bearings from within the hull or nearer than the
    scanner measures.

    Args:
        scan: its fields make sense (``malformed``).
        mount: of the scanner.
        parts: bearings where the scanner sees the robot itself, radians.
        half_width: radians around each.
        radius: of the hull around base_link, metres.
        before: ranges of the scan before, float32 [N]; None or of another size: unknown.

    Returns:
        What stands where. -inf counts as an obstacle at range_min, as REP-117 has it, and finite
        ranges under range_min as obstacles where they are.
    """
    ranges = np.asarray(scan.ranges, np.float64)
    there = beams(
        ranges.size, scan.angle_min, scan.angle_increment, mount, parts, half_width, radius
    )
    first, last, value = distinct_returns(ranges)
    good, near = measured(value, scan), too_near(value, scan)
    middle = (first + last) // 2
    own = there.masked[middle] & (near | (value <= there.hull[middle]))
    good, near = good & ~own, near & ~own
    begins, ends = near.copy(), near.copy()
    centre, copies = (first + last) / 2, last - first + 1
    begins[good], ends[good], value[good] = _surfaces(centre[good] * there.step, value[good])
    value = np.where(value == -np.inf, scan.range_min, value)

    narrow = copies * there.step <= math.radians(LONE_DEG)
    (lone,) = (good & begins & ends & narrow & (value < LONE_M)).nonzero()
    ghosts = [k for k in lone if not _again(before, ranges.size, first[k], value[k], there.step)]
    good[ghosts] = begins[ghosts] = ends[ghosts] = False

    met, half = good | near, np.maximum(copies, _spacing(centre[good], there.step)) / 2
    index = np.concatenate([centre[met], (centre - half)[begins], (centre + half)[ends]])
    distance = np.concatenate([value[met], value[begins], value[ends]])
    angle, points = _places(index, distance, scan, mount)
    known = np.repeat(good, copies)
    returns = angle[: np.count_nonzero(met)]
    unknown, unlooked = (_gaps(seen, scan, mount) for seen in (known, known | there.masked))
    return ScanView(mount, there, known, points, distance, returns, unknown, unlooked, len(ghosts))


def _spacing(centre: np.ndarray, step: float) -> float:
    """Mean number of beams from a return (float64 [M], fractional beams) to the next close by."""
    apart = np.diff(centre)
    close = apart[apart * step <= math.radians(BRIDGE_DEG)]
    return float(close.mean()) if len(close) else 1.0


def _places(
    index: np.ndarray, distance: np.ndarray, scan: Scan, mount: Mount
) -> tuple[np.ndarray, np.ndarray]:
    """Bearings (radians) and places (float64 [P, 2], metres) of returns at fractional beams."""
    angle = mount.bearings(scan.angle_min + index * scan.angle_increment)
    x, y = mount.x + distance * np.cos(angle), mount.y + distance * np.sin(angle)
    return angle, np.array((x, y)).T


def _gaps(seen: np.ndarray, scan: Scan, mount: Mount) -> np.ndarray:
    """float64 [G, 2], middle (bearing) and width of the arcs between the beams seen, radians."""
    (index,), step = seen.nonzero(), abs(scan.angle_increment)
    if not len(index):
        return np.array([[0.0, 2 * math.pi]])
    # The last gap goes on from the last beam seen, past the end of the scan, to the first.
    index = np.concatenate((index, [index[0] + 2 * math.pi / step]))
    apart = index[1:] - index[:-1]
    (wide,) = (apart > 1.5).nonzero()
    middle = (index[wide] + index[wide + 1]) / 2
    bearing = mount.bearings(scan.angle_min + middle * scan.angle_increment)
    return np.array((bearing, (apart[wide] - 1) * step)).T


def _again(before: np.ndarray | None, size: int, first: int, value: float, step: float) -> bool:
    """Whether the scan before had a return at this place; an unknown one may have had it."""
    if before is None or len(before) != size:
        return True
    aside = round(math.radians(AGAIN_DEG) / step)
    there = before[max(first - aside, 0) : first + aside + 1]
    return bool((np.abs(there - value) <= AGAIN_M).any())


def _surfaces(angle: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tell surfaces apart and average along each.

    Args:
        angle: float64 [M], radians, rising, of returns.
        value: float64 [M], their ranges, metres.

    Returns:
        bool [M] whether a return is the first of its surface, bool [M] whether it is the last,
        float64 [M] its range, metres: the mean along straight lines from return to return, as far
        to the one side as to the other, so that a wall seen at a slant stays where it is.
    """
    if len(value) < 2:
        return np.ones(len(value), bool), np.ones(len(value), bool), value
    apart, middle = np.diff(angle), (value[1:] + value[:-1]) / 2
    differ = np.abs(np.diff(value)) / np.minimum(value[1:], value[:-1])
    degrees = np.degrees(apart)
    broken = (degrees > BRIDGE_DEG) | (differ > np.maximum(SURFACE * degrees, SURFACE_LEAST))
    begins, ends = np.concatenate((_BORDER, broken)), np.concatenate((broken, _BORDER))
    surface = begins.cumsum() - 1
    aside = np.minimum(angle - angle[begins][surface], angle[ends][surface] - angle)
    aside = np.minimum(aside, math.radians(SMOOTH_DEG))
    area = np.concatenate(([0.0], (apart * middle).cumsum()))
    half_slope = np.concatenate((np.diff(value) / apart / 2, [0.0]))

    def area_to(at: np.ndarray) -> np.ndarray:
        k = np.searchsorted(angle, at, "right") - 1
        beyond = at - angle[k]
        return area[k] + beyond * (value[k] + beyond * half_slope[k])

    whole = area_to(angle + aside) - area_to(angle - aside)
    inner = aside > 0
    return begins, ends, np.where(inner, whole / np.where(inner, 2 * aside, 1.0), value)
