"""The LiDAR estimate against scenes with known answers and against every kind of bad scan."""

import dataclasses
import math

import numpy as np
import pytest
from cfnav_ros.lidar.estimate import (
    SweptDisc,
    Verdict,
    estimate_collision,
)
from cfnav_ros.lidar.sweep import (
    NOMINAL,
    ErrorModel,
    free_way,
    hidden_probability,
    seen_probability,
)

from tests.ros.lidar_scans import replaced, room, scan_of, wall_ahead

DISC = SweptDisc()
REACH = DISC.radius + DISC.margin
NEAR = NOMINAL.unseen_near + 0.005
"""No less can be said of a free way beside things: some of them reach out above the plane."""


@pytest.mark.parametrize("base_x", [0.25, 0.40, 0.55, 1.0])
def test_wall_ahead_gives_the_distance_to_contact(base_x):
    estimate = estimate_collision(scan_of(wall_ahead(base_x)))
    assert estimate.verdict is Verdict.GOOD
    assert estimate.reason == ""
    assert estimate.clearance == pytest.approx(base_x - REACH, abs=0.002)
    assert estimate.known_fraction == pytest.approx(1.0, abs=0.01)


UNBIASED = ErrorModel(bearing_bias_deg=0.0)
EXACT = ErrorModel(bearing_deg=0.0, heading_deg=0.0, end=0.01, end_bias=0.0, scale=0.0)


def one_point(x, y=0.0, errors=EXACT, range_m=0.0):
    """Probability of touching a single point; no range error unless a range is given."""
    of_points = errors.of_range(np.array([range_m]))
    return seen_probability(np.array([[x, y]]), of_points, 0.175, 0.25, errors)


def test_the_free_way_of_a_disc_by_hand():
    points = np.array([[0.5, 0.0], [0.5, 0.105], [0.5, 0.2], [-0.2, 0.0]])
    # 0.5 - 0.175; sqrt(0.175^2 - 0.105^2) = 0.14; beside the disc; behind it.
    assert free_way(points, 0.175) == pytest.approx([0.325, 0.36, math.inf, math.inf])


def test_the_probability_of_one_point_by_hand():
    assert one_point(0.425) == pytest.approx(0.5)  # the way is the step
    # One centimetre is one sigma: Phi(1) and Phi(-1); two: Phi(-2).
    assert one_point(0.415) == pytest.approx(0.8413, abs=1e-3)
    assert one_point(0.435) == pytest.approx(0.1587, abs=1e-3)
    assert one_point(0.445) == pytest.approx(0.0228, abs=1e-3)
    # The range's own error: 0.5 % of 2 m is another centimetre, so sigma is 0.01 sqrt(2).
    assert one_point(0.435, range_m=2.0) == pytest.approx(0.2398, abs=1e-3)


def test_a_grazed_point_is_uncertain_and_not_all_or_nothing():
    """At 0.2 m a degree is 3.5 mm: half of the turns touch at the hull's edge."""
    turning = dataclasses.replace(EXACT, heading_deg=1.0)
    assert one_point(0.20, 0.170) > 0.99
    assert one_point(0.20, 0.180) == 0.0
    assert 0.4 < one_point(0.20, 0.1745, turning) < 0.7
    values = [one_point(0.20, y, turning) for y in np.linspace(0.16, 0.20, 41)]
    assert values == sorted(values, reverse=True)
    assert max(np.abs(np.diff(values))) < 0.15


def test_nearer_is_never_safer():
    values = [
        estimate_collision(scan_of(wall_ahead(x))).probability for x in np.linspace(0.2, 1.2, 201)
    ]
    assert values == sorted(values, reverse=True)
    assert values[0] > 0.999
    assert values[-1] == pytest.approx(NOMINAL.unseen, abs=1e-3)


@pytest.mark.parametrize("seed", range(20))
def test_left_and_right_are_alike(seed):
    rng = np.random.default_rng(seed)
    ranges = np.repeat(rng.uniform(0.25, 0.9, 360).astype(np.float32), 3)
    ranges[rng.random(1080) < 0.1] = np.inf
    scan = dataclasses.replace(scan_of(room), ranges=ranges)
    disc = SweptDisc(mount_yaw_deg=0.0)
    # Beam i looks along angle_min + i * increment, so the mirrored scan begins at -angle_max.
    mirrored = dataclasses.replace(
        scan, ranges=ranges[::-1].copy(), angle_min=-scan.angle_max, angle_max=-scan.angle_min
    )
    one, other = (estimate_collision(one, disc, UNBIASED) for one in (scan, mirrored))
    assert one.probability == pytest.approx(other.probability, abs=1e-6)
    assert one.clearance == pytest.approx(other.clearance, abs=1e-6)
    assert one.known_fraction == pytest.approx(other.known_fraction, abs=0.01)


def test_what_an_unknown_arc_hides_by_hand():
    """Straight ahead beams leave the swept area 0.425 + 0.04 m from the LiDAR."""
    scanner, flat = (-0.04, 0.0), ErrorModel(thinnest=0.0)

    def arc(width_deg, centre_deg=0.0, errors=flat):
        half, centre = math.radians(width_deg) / 2, math.radians(centre_deg)
        gap = np.array([[centre - half, centre + half]])
        return hidden_probability(gap, scanner, 0.175, 0.25, errors)

    assert arc(10) == pytest.approx(0.465 * math.radians(10) / 0.35, rel=0.02)
    assert arc(3, errors=NOMINAL) == 0.0  # 2.4 cm: nothing is that thin
    assert arc(20, errors=NOMINAL) == pytest.approx((0.465 * 0.349 - 0.03) / 0.35, rel=0.03)
    assert arc(30, 150) == 0.0  # behind the robot
    # A post at 58.3 degrees hides 5.2: its beams leave the corridor after 0.206 m, 1.9 cm wide.
    assert arc(5.2, 58.3) == pytest.approx(0.206 * math.radians(5.2) / 0.35, rel=0.02)
    assert arc(5.2, 58.3, NOMINAL) == 0.0


def test_a_blocked_and_a_free_way():
    blocked = estimate_collision(scan_of(wall_ahead(0.25 + REACH - 0.05)))
    free = estimate_collision(scan_of(wall_ahead(0.25 + REACH + 0.15)))
    assert blocked.probability > 0.8
    assert free.probability < NEAR


def test_bearings_announced_too_far_left_are_put_right():
    """A wall at 45 degrees: by hand a degree moves what it leaves by 0.465 m x 0.0175 = 8 mm."""

    def wall(side, said_deg=0.0):
        def distance(bearing):
            across = math.cos(bearing - math.radians(said_deg) - side * math.pi / 4)
            return min(0.45 / across, 3.0) if across > 0.15 else 3.0

        return scan_of(distance)

    for side in (1, -1):
        told = [
            estimate_collision(scan, errors=ErrorModel(bearing_bias_deg=bias)).clearance
            for scan, bias in ((wall(side), 0.0), (wall(side, 1.0), 1.0), (wall(side, 1.0), 0.0))
        ]
        assert told[1] == pytest.approx(told[0], abs=0.002)
        assert told[2] - told[0] == pytest.approx(side * 0.008, abs=0.003)


def test_a_wall_alongside_is_no_obstacle():
    def corridor(bearing):
        side = abs(math.sin(bearing))
        return min(0.19 / side, 3.0) if side > 0.01 else 3.0

    estimate = estimate_collision(scan_of(corridor))
    assert estimate.verdict is Verdict.GOOD
    assert estimate.probability < NEAR


def test_a_chair_leg_off_centre_counts_where_the_disc_meets_it():
    x, y = 0.45, 0.12
    bearing0, range0 = math.atan2(y, x + 0.04), math.hypot(x + 0.04, y)

    def leg(bearing):
        return range0 if abs(bearing - bearing0) < math.radians(0.8) else room(bearing)

    estimate = estimate_collision(scan_of(leg))
    free = x - math.sqrt(DISC.radius**2 - y**2) - DISC.margin
    assert estimate.clearance == pytest.approx(free, abs=0.01)


def leg_at(x, y):
    """A scan of a thin leg in base_link in the middle of a room, announced as the A1 does."""
    bearing0, range0 = math.atan2(y, x + 0.04), math.hypot(x + 0.04, y)
    bearing0 += math.radians(NOMINAL.bearing_bias_deg)

    def leg(bearing):
        return range0 if abs(bearing - bearing0) < math.radians(0.5) else room(bearing)

    return scan_of(leg)


@pytest.mark.parametrize("aside", [0.178, 0.180, 0.184])
def test_a_leg_beside_the_way_leaves_it_free_for_probability_and_clearance_alike(aside):
    estimate = estimate_collision(leg_at(0.2, aside + 0.003))  # a return is 3 mm wide there
    assert estimate.probability < 0.2
    assert estimate.clearance > 2.0


def test_who_is_let_begin_is_not_stopped_by_the_same_view():
    """What the veto passes, the clearance leaves a step for, but for the margin and the end."""
    short = DISC.margin - NOMINAL.end_bias
    passed = 0
    for x in np.linspace(0.15, 0.5, 15):
        for y in np.linspace(0.0, 0.2, 41):
            estimate = estimate_collision(leg_at(x, y))
            if estimate.probability < 0.5:
                passed += 1
                assert estimate.clearance > DISC.step - short - 0.001, (x, y)
    assert passed > 100


def test_only_what_is_ahead_matters():
    """Left, right, behind: near things there do not block a MoveAhead (the mounting is turned)."""
    for centre in (90, -90, 179):
        estimate = estimate_collision(
            replaced(scan_of(room), 0.25, centre - 20, min(centre + 20, 180))
        )
        assert estimate.probability < NEAR, centre


def test_the_mounting_decides_what_is_ahead():
    """Laser angle 0 is the robot's left; taken for forward it would block the way."""
    left = replaced(scan_of(room), 0.35, 80, 100)
    assert estimate_collision(left).probability < NEAR
    assert estimate_collision(left, SweptDisc(mount_yaw_deg=0.0)).probability > 0.9


# Other motions


def others(scan, disc=DISC):
    return {other.motion: other for other in estimate_collision(scan, disc).others}


def test_a_turn_touches_only_what_the_hull_touches():
    free = others(scan_of(room))
    beside = others(replaced(scan_of(room), 0.30, 80, 100))  # 0.30 m to the left
    touching = others(replaced(scan_of(room), 0.172, 86, 94))
    for side in ("RotateLeft", "RotateRight"):
        assert free[side].probability < 1e-6
        assert free[side].verdict is Verdict.GOOD
        assert beside[side].clearance == pytest.approx(math.hypot(0.30, 0.04) - 0.175, abs=0.01)
        assert beside[side].probability < 1e-6
        assert touching[side].probability > 0.3


def test_backing_off_is_never_sure():
    """The camera's bracket hides the middle of the way, so it is never GOOD."""
    back = others(scan_of(room))["MoveBack"]
    assert back.verdict is Verdict.DEGRADED
    assert back.probability < 0.15
    wall = others(replaced(replaced(scan_of(room), 0.35, 150, 180), 0.35, -180, -150))["MoveBack"]
    # By hand: the LiDAR stands 0.04 m nearer to what is behind.
    assert wall.clearance == pytest.approx(0.35 + 0.04 - REACH, abs=0.02)
    assert wall.probability > 0.9
    touching = replaced(replaced(scan_of(room), math.inf, 140, 180), math.inf, -180, -140)
    assert others(touching)["MoveBack"].verdict is Verdict.BLIND  # nearer than range_min


def test_a_malformed_scan_judges_no_motion():
    for other in estimate_collision(dataclasses.replace(scan_of(room), angle_increment=0.0)).others:
        assert (other.verdict, other.probability, other.clearance) == (Verdict.BLIND, 1.0, 0.0)


def test_an_arc_behind_counts_whole_for_a_turn():
    """It crosses the bearing of 180 degrees, where bearings start again."""
    for width, verdict in ((8, Verdict.GOOD), (20, Verdict.DEGRADED), (40, Verdict.BLIND)):
        scan = replaced(scan_of(room), math.inf, 180 - width / 2, 180)
        scan = replaced(scan, math.inf, -180, -180 + width / 2)
        no_parts = estimate_collision(scan, SweptDisc(mask_bearings_deg=""))
        assert no_parts.others[0].verdict is verdict, width
        assert no_parts.verdict is Verdict.GOOD
