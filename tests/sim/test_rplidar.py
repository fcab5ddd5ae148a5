"""The driver's shape of a scan: mounting, triples, blind spots."""

import math

import numpy as np
import pytest
from sim_bridge.rplidar import ANGLE_MAX, ANGLE_MIN, BINS, driver_ranges


def bin_at(bearing_deg):
    """Index of the bin that announces a bearing from the robot's front."""
    laser = math.remainder(math.radians(bearing_deg) - math.pi / 2, math.tau)
    return round((laser - ANGLE_MIN) / ((ANGLE_MAX - ANGLE_MIN) / (BINS - 1)))


@pytest.mark.parametrize("bearing", [0, 30, 45, 90, 91, 150, 210, 269, 271, 315, 359])
def test_single_return_fills_three_bins_at_its_bearing(bearing):
    distances = np.full(360, np.inf, dtype=np.float32)
    distances[bearing] = 2.5
    hit = np.flatnonzero(np.isfinite(driver_ranges(distances)))
    assert hit.size == 3
    assert hit[1] - hit[0] == hit[2] - hit[1] == 1
    assert abs(hit[1] - bin_at(bearing)) <= 1


def test_header_angles_are_the_ones_a_turtlebot4_publishes():
    assert pytest.approx(-3.12414, abs=1e-5) == ANGLE_MIN
    assert pytest.approx(3.14159, abs=1e-5) == ANGLE_MAX


def test_posts_and_bracket_hide_their_sectors():
    ranges = driver_ranges(np.full(360, 2.0, dtype=np.float32))
    for bearing in (58, -58, 112, -112, 180):
        assert ranges[bin_at(bearing)] == np.inf
    for bearing in (0, 50, -50, 70, 100, -100, 120, 170, -170):
        assert ranges[bin_at(bearing)] == 2.0
    assert np.count_nonzero(np.isinf(ranges)) == 3 * (5 + 5 + 7 + 7 + 7)


@pytest.mark.parametrize(
    ("distance", "published"),
    [(0.149, np.inf), (0.151, 0.151), (11.9, 11.9), (12.1, np.inf), (np.inf, np.inf)],
)
def test_too_near_and_too_far_are_no_return(distance, published):
    ranges = driver_ranges(np.full(360, distance, dtype=np.float32))
    assert ranges.dtype == np.float32
    assert ranges[bin_at(0)] == np.float32(published)
