"""The LiDAR estimate against every kind of scan that a driver may send."""

import dataclasses
import math

import numpy as np
import pytest
from cfnav_ros.lidar.estimate import Scan, SweptDisc, Verdict, _arcs, estimate_collision
from cfnav_ros.lidar.returns import Mount, distinct_returns
from cfnav_ros.lidar.sweep import NOMINAL, ErrorModel

from tests.ros.lidar_scans import replaced, room, scan_of, wall_ahead

DISC = SweptDisc()
REACH = DISC.radius + DISC.margin
NEAR = NOMINAL.unseen_near + 0.01


@pytest.mark.parametrize("value", [math.inf, math.nan, 0.0, -1.0, 0.10, 13.0, -math.inf, 2.0])
def test_a_scan_of_one_value_is_blind(value):
    scan = scan_of(room)
    estimate = estimate_collision(
        dataclasses.replace(scan, ranges=np.full_like(scan.ranges, value))
    )
    assert estimate.verdict is Verdict.BLIND
    assert (estimate.probability, estimate.clearance) == (1.0, 0.0)
    assert estimate.reason.endswith(".")


@pytest.mark.parametrize("value", [math.inf, math.nan])
@pytest.mark.parametrize(
    ("width", "verdict"),
    [(4, Verdict.GOOD), (20, Verdict.DEGRADED), (30, Verdict.BLIND), (90, Verdict.BLIND)],
)
def test_an_unknown_sector_ahead(value, width, verdict):
    estimate = estimate_collision(replaced(scan_of(room), value, -width / 2, width / 2))
    assert estimate.verdict is verdict
    if verdict is Verdict.DEGRADED:
        assert 0.3 < estimate.probability < 0.7
        assert "20 degrees" in estimate.reason


def test_an_unknown_sector_behind_does_not_matter():
    assert estimate_collision(replaced(scan_of(room), math.inf, 80, 180)).verdict is Verdict.GOOD


def test_scattered_missing_returns_are_normal():
    scan = scan_of(room)
    missing = np.repeat(np.random.default_rng(0).random(360) < 0.1, 3)
    estimate = estimate_collision(
        dataclasses.replace(scan, ranges=np.where(missing, np.inf, scan.ranges))
    )
    assert estimate.verdict is Verdict.GOOD
    assert 0.85 < estimate.known_fraction < 0.95
    assert estimate.probability < NEAR


@pytest.mark.parametrize("value", [0.10, -math.inf])
def test_a_return_under_range_min_is_an_obstacle(value):
    estimate = estimate_collision(replaced(scan_of(room), value, -3, 3))
    assert estimate.clearance == 0.0
    assert estimate.probability > 0.99


def test_the_robots_own_posts_are_no_obstacle():
    scan = replaced(replaced(scan_of(room), 0.134, 56, 60), 0.134, -60, -56)
    assert estimate_collision(scan).probability < NEAR
    assert estimate_collision(scan).verdict is Verdict.GOOD
    unmasked = SweptDisc(mask_bearings_deg="")
    assert estimate_collision(scan, unmasked).probability > 0.99


def test_what_stands_on_the_hull_is_masked_and_what_stands_behind_it_is_not():
    """By hand: at 20 degrees the hull ends sqrt(0.175^2 - 0.0137^2) + 0.0376 = 0.212 m away."""
    mast = SweptDisc(mask_bearings_deg="20")
    for at, free in ((0.16, True), (0.205, True), (0.22, False), (0.3, False)):
        scan = replaced(scan_of(room), at, 17, 23)
        estimate = estimate_collision(scan, mast)
        assert estimate.verdict is Verdict.GOOD
        assert (estimate.probability < NEAR) is free, at
        assert (estimate.clearance > 2.0) is free, at
        assert (estimate_collision(scan, mast).others[0].probability < 1e-6) is (free or at > 0.22)
        assert estimate_collision(scan).probability > 0.99


@pytest.mark.parametrize(("returns", "copies"), [(360, 1), (1034, 1), (360, 3), (1080, 3)])
def test_the_number_of_ranges_may_change(returns, copies):
    estimate = estimate_collision(scan_of(wall_ahead(0.6), returns, copies))
    assert estimate.verdict is Verdict.GOOD
    assert estimate.clearance == pytest.approx(0.6 - REACH, abs=0.003)


def test_a_turned_round_scan_says_the_same():
    scan = scan_of(wall_ahead(0.5))
    mirrored = Scan(
        scan.ranges[::-1], scan.angle_max, scan.angle_min, -scan.angle_increment, 0.15, 12.0
    )
    assert estimate_collision(mirrored).clearance == pytest.approx(
        estimate_collision(scan).clearance, abs=1e-6
    )


@pytest.mark.parametrize(
    "change",
    [
        {"ranges": np.zeros(0, np.float32)},
        {"ranges": np.full(1, 2.0, np.float32)},
        {"ranges": np.full(700, 2.0, np.float32)},
        {"angle_increment": 0.0},
        {"angle_increment": math.nan},
        {"angle_increment": -0.0058},
        {"angle_min": math.inf},
        {"angle_max": 0.0},
        {"range_min": 12.0, "range_max": 0.15},
        {"range_max": math.nan},
    ],
)
def test_malformed_fields_are_blind(change):
    estimate = estimate_collision(dataclasses.replace(scan_of(room), **change))
    assert estimate.verdict is Verdict.BLIND
    assert estimate.probability == 1.0
    assert estimate.reason.endswith(".")


def test_a_scanner_that_looks_away_is_blind():
    backwards = SweptDisc(mount_yaw_deg=-90.0)
    half = scan_of(room)
    keep = slice(0, half.ranges.size // 2)  # laser -pi..0, the robot's right and front when upright
    front = dataclasses.replace(
        half,
        ranges=half.ranges[keep],
        angle_max=half.angle_min + (half.ranges[keep].size - 1) * half.angle_increment,
    )
    assert estimate_collision(front).verdict is Verdict.GOOD
    assert estimate_collision(front, backwards).verdict is Verdict.BLIND


def test_runs_of_equal_values_are_one_return():
    first, last, value = distinct_returns(np.array([1.0, 1.0, 1.0, 2.0, np.inf, np.inf]))
    assert (first.tolist(), last.tolist()) == ([0, 3, 4], [2, 3, 5])
    assert value.tolist() == [1.0, 2.0, np.inf]


def test_a_mask_that_is_no_list_of_numbers_is_refused_with_a_sentence():
    with pytest.raises(ValueError, match="mask_bearings_deg is 'left'"):
        SweptDisc(mask_bearings_deg="left")


@pytest.mark.parametrize("rear_deg", [180, 135])
def test_a_scanner_that_hangs_upside_down(rear_deg):
    """It turns clockwise: the same ranges in reverse order are the same room."""
    scan = replaced(scan_of(wall_ahead(0.5)), 0.5, rear_deg - 45, rear_deg)
    hung = dataclasses.replace(
        scan, ranges=scan.ranges[::-1].copy(), angle_min=-scan.angle_max, angle_max=-scan.angle_min
    )
    mount = Mount(-0.04, 0.0, math.pi / 2, upside_down=True)
    exact = ErrorModel(bearing_bias_deg=0.0)
    assert estimate_collision(hung, errors=exact, mount=mount).clearance == pytest.approx(
        estimate_collision(scan, errors=exact).clearance, abs=1e-6
    )
    assert Mount(0.0, 0.0, 1.0).corrected(0.1).yaw == pytest.approx(0.9)
    assert Mount(0.0, 0.0, 1.0, upside_down=True).corrected(0.1).yaw == pytest.approx(1.1)


@pytest.mark.parametrize("centre", [170, -170, 180, 10])
@pytest.mark.parametrize("back", [False, True])
def test_an_arc_across_the_end_of_a_wide_sector_counts_on_both_sides(centre, back):
    """By hand: 50 degrees wide in a sector of 170 to each side, 20 of the turn are left out."""
    gaps = np.radians([[centre, 50.0]])
    found = np.degrees(_arcs(gaps, back, math.radians(170)))
    middle = centre - 180 if back else centre
    turns = [(middle - 25 + turn, middle + 25 + turn) for turn in (-360, 0, 360)]
    inside = [(max(low, -170), min(high, 170)) for low, high in turns]
    expected = sorted(arc for arc in inside if arc[1] > arc[0])
    assert sorted(map(tuple, found)) == [pytest.approx(arc) for arc in expected]


def test_a_scan_that_does_not_reach_round_leaves_the_rest_unknown():
    """By hand: 90 degrees to each side; what MoveBack would sweep was never looked at."""
    scan = scan_of(room)
    bearing = np.degrees(scan.angle_min + np.arange(1080) * scan.angle_increment) + 90
    front = np.flatnonzero(np.abs(bearing) <= 90)
    half = dataclasses.replace(
        scan,
        ranges=scan.ranges[front],
        angle_min=scan.angle_min + front[0] * scan.angle_increment,
        angle_max=scan.angle_min + front[-1] * scan.angle_increment,
    )
    estimate = estimate_collision(half)
    assert estimate.verdict is Verdict.GOOD
    assert estimate.probability == pytest.approx(estimate_collision(scan).probability, abs=0.01)
    assert [other.verdict for other in estimate.others] == [Verdict.BLIND] * 3
