"""The error model: what a motion sweeps, and the probability that it touches something there.

Pure: numpy in, numbers out. The motion goes along +x of the frame that the points are given in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from statistics import NormalDist

import numpy as np

from cfnav_core.robot.settings import setting

HEADINGS = 15
"""Equally likely headings that stand for all: each moves the probability by at most 1/15."""

_QUANTILES = np.array([NormalDist().inv_cdf((k + 0.5) / HEADINGS) for k in range(HEADINGS)])
_RAYS = np.linspace(0.0, 1.0, 9)
"""Where an unknown arc is sampled, as shares of it."""
_EVEN = np.full(len(_RAYS), 1 / len(_RAYS))


@dataclass(frozen=True)
class ErrorModel:
    """Magnitudes of the errors between a scan and the motion that follows: one sigma each.

    MoveAhead collides when the robot drives further than the way is free. Neither is exactly known:

    - The scan announces all bearings ``bearing_bias_deg`` too far left; they are put right first.
    - The robot keeps its heading to ``heading_deg`` and the scan a bearing to ``bearing_deg``.
      Both turn the scan against the motion, so the free way c is worked out for 15 equally likely
      turns; an obstacle that is only grazed stands in the way of some of them.
    - The robot ends ``end_bias`` + ``end`` off the step and its odometry counts ``scale`` of it
      wrong; the obstacle stands ``range_share`` of its range r (at least ``range_floor``) from
      where the scan shows it. So for each turn the chance is Phi((step + end_bias - c) / sigma),
      sigma^2 = end^2 + (scale step)^2 + (range_share r)^2, and p_seen is their mean.
    - Where nothing returned, an arc hides what is no wider than the arc. Nothing thinner than
      ``thinnest`` stands on a floor; beyond that the chance p_hidden is the share of the swept
      width that the arc covers where its beams leave the swept area.
    - ``unseen`` is the share of motions, free as far as the plane of the scanner shows, that meet
      something above or below it (table tops, open drawers). Where the plane shows something
      within ``overhang`` beyond the motion's end, or ``overhang_aside`` beside the hull, it is
      ``unseen_near``: what stands on the floor reaches out further up.

    p = 1 - (1 - p_seen) (1 - p_hidden) (1 - unseen). The formula is ours, the paper gives none.

    Sources: A1M8 data sheet (errors of ranges under 1 %, taken as two sigma; resolution 0.5 mm);
    the A1's driver, which announces a sample up to a degree left of where it was taken (ahead of
    the robot by 0.67 degrees on average at 8 kHz and by 0.5 at 2 kHz) and at 2 kHz to whole degrees
    (1 / sqrt(12)); the executor's tolerances (``motion.MotionLimits``:
    a motion ends within 5 mm before its step, so 2.5 mm on average, a turn within 0.5 degrees); 1 %
    for odometry. Within what these allow, ``end``, ``end_bias`` and ``range_share`` were settled in
    the built-in rooms 0 to 19 by the calibration error of ``python -m studies.deploy.calibration
    --seeds 0 19 --out out/training``, which also counts the shares ``unseen`` and ``unseen_near``.
    """

    range_share: float = setting(0.005, "error of a range, share of it", 0.0, 0.1)
    range_floor: float = setting(0.0005, "least error of a range, m", 0.0, 0.05)
    bearing_bias_deg: float = setting(0.6, "bearings announced too far left, deg", -5.0, 5.0)
    bearing_deg: float = setting(0.29, "error of a bearing, deg", 0.0, 10.0)
    heading_deg: float = setting(0.5, "error of the motion's heading, deg", 0.0, 10.0)
    end: float = setting(0.002, "error of the motion's end, m", 0.0001, 0.1)
    end_bias: float = setting(-0.0025, "mean way beyond the step, m", -0.1, 0.1)
    scale: float = setting(0.01, "error of odometry, share of the way", 0.0, 0.2)
    thinnest: float = setting(0.03, "thinnest obstacle on a floor, m", 0.0, 0.3)
    unseen: float = setting(0.007, "motions that meet what the plane cannot show", 0.0, 0.5)
    unseen_near: float = setting(0.04, "the same beside what it shows", 0.0, 0.5)
    overhang: float = setting(0.1, "how far that reaches, m", 0.0, 1.0)
    overhang_aside: float = setting(0.01, "and to the sides, m", 0.0, 0.5)

    @cached_property
    def turns(self) -> np.ndarray:
        """float64 [HEADINGS], radians: equally likely turns of the scan against the motion."""
        return _QUANTILES * math.radians(math.hypot(self.bearing_deg, self.heading_deg))

    def of_range(self, ranges: np.ndarray) -> np.ndarray:
        """Errors of the LiDAR's ranges, metres, one sigma: float [N] of float [N]."""
        return np.maximum(self.range_share * ranges, self.range_floor)


NOMINAL = ErrorModel()
"""The magnitudes of the TurtleBot 4 with its RPLIDAR A1M8 and our executor."""


def free_way(points: np.ndarray, radius: float) -> np.ndarray:
    """How far a disc can advance along x before it touches a point.

    Args:
        points: float [..., 2], metres, in the frame of the disc's centre.
        radius: of the disc, metres.

    Returns:
        float [...], metres; inf for points that the disc passes, not positive for points in it.
    """
    x, y = points[..., 0], points[..., 1]
    room = radius**2 - y**2
    # A point behind the centre is only left further behind.
    ahead = (x > 0) & (room > 0)
    return np.where(ahead, x - np.sqrt(np.where(ahead, room, 0.0)), np.inf)


def seen_probability(
    points: np.ndarray, of_points: np.ndarray, radius: float, step: float, errors: ErrorModel
) -> float:
    """Probability that a disc which advances by a step touches one of the points.

    Args:
        points: float [N, 2], metres, in the frame of the disc's centre.
        of_points: float [N], metres, the error of where each point is shown, one sigma.
        radius: of the disc, metres.
        step: length of the motion, metres.
        errors: of the motion; see there for the formula.
    """
    x, y = points.T
    c, s = np.cos(errors.turns)[:, None], np.sin(errors.turns)[:, None]
    # The others lie beside the way whatever the turn, or beyond it.
    aside = (radius + np.abs(x) * s.max()) / c.min()
    close = (x > -radius) & (x < step + 2 * radius) & (np.abs(y) < aside)
    if not close.any():
        return 0.0
    x, y, of_points = x[close], y[close], of_points[close]
    way = free_way(np.stack([c * x + s * y, c * y - s * x], axis=-1), radius)
    nearest = way.argmin(axis=1)
    way = way[np.arange(HEADINGS), nearest]
    sigma = np.sqrt(errors.end**2 + (errors.scale * step) ** 2 + of_points[nearest] ** 2)
    late = (step + errors.end_bias - way) / (sigma * math.sqrt(2))
    return sum(0.5 * (1 + math.erf(value)) for value in late.tolist()) / HEADINGS


def hidden_probability(
    gaps: np.ndarray, scanner: tuple[float, float], radius: float, step: float, errors: ErrorModel
) -> float:
    """Probability that something stands in the swept area where no beam returned.

    Args:
        gaps: float [G, 2], bearings between which nothing is known, radians, first < second.
        scanner: its place in the frame of the disc's centre, metres.
        radius: of the disc, metres.
        step: length of the motion, metres.
        errors: see there for the formula.
    """
    arcs = gaps[:, 1] - gaps[:, 0]
    # No beam within the swept area is longer than this, so narrower arcs hide nothing.
    longest = step + radius + math.hypot(*scanner)
    wide = arcs * longest > errors.thinnest
    if not wide.any():
        return 0.0
    gaps, arcs = gaps[wide], arcs[wide]
    rays = gaps[:, :1] + arcs[:, None] * _RAYS
    width = arcs * (_way_out(rays, scanner, radius, step) @ _EVEN)
    chance = ((width - errors.thinnest) / (2 * radius)).tolist()
    return 1.0 - math.prod(1.0 - min(max(one, 0.0), 1.0) for one in chance)


def _way_out(
    bearing: np.ndarray, scanner: tuple[float, float], radius: float, step: float
) -> np.ndarray:
    """Length of a beam within the area that a disc sweeps ahead; 0 where it leaves behind it."""
    dx, dy = np.cos(bearing), np.sin(bearing)
    dy = np.where(np.abs(dy) < 1e-9, 1e-9, dy)
    x, y = scanner
    side = (np.copysign(radius, dy) - y) / dy
    x_side = x + side * dx
    along = (x - step) * dx + y * dy
    room = radius**2 - (x - step) ** 2 - y**2
    front = np.sqrt(np.maximum(along**2 + room, 0.0)) - along
    return np.where(x_side <= 0, 0.0, np.where(x_side <= step, side, front))
