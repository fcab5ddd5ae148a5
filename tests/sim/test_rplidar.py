"""The driver's shape of a scan: mounting, bins of samples, blind spots."""

import math

import numpy as np
import pytest
from sim_bridge.robot.rplidar import (
    ANGLE_MAX,
    ANGLE_MIN,
    BLIND_SECTORS_DEG,
    MODES,
    SENSITIVITY,
    STANDARD,
    bearings,
    driver_ranges,
    sample_angles,
)

BOTH = pytest.mark.parametrize("mode", MODES.values(), ids=list(MODES))


def turn(mode, distance=2.0, phase=0.5):
    """What the driver makes of a turn that sees one distance all round."""
    angles = sample_angles(mode, phase)
    return driver_ranges(angles, np.full(len(angles), distance, np.float32), mode)


def announced_deg(mode):
    """Bearing from the robot's front that the message gives each bin."""
    laser = np.linspace(ANGLE_MIN, ANGLE_MAX, mode.bins)
    return (np.degrees(laser) + 90.0 + 180.0) % 360.0 - 180.0


def bin_at(mode, bearing_deg):
    return int(np.abs(announced_deg(mode) - bearing_deg).argmin())


def test_header_angles_are_the_ones_a_turtlebot4_publishes():
    assert pytest.approx(-3.12414, abs=1e-5) == ANGLE_MIN
    assert pytest.approx(3.14159, abs=1e-5) == ANGLE_MAX


@pytest.mark.parametrize("rate_khz", [8.0, 2.0])
def test_the_driver_takes_a_turn_of_10_hz_for_its_bins(rate_khz):
    mode = SENSITIVITY if rate_khz == 8.0 else STANDARD
    assert int(rate_khz * 1000 / 10 / 360 + 1) == mode.multiple
    # and the samples are those of a turn at 7.4 to 7.8 Hz
    assert 7.4 < rate_khz * 1000 / mode.samples < 7.8


def test_a_sample_fills_its_bin_and_the_next_until_another_overwrites_them():
    """By hand, three bins a degree from the rear on, the message in reverse."""
    angles = np.array([10.0, 10.4, 30.2, 359.9])
    distances = np.array([1.0, 2.0, 3.0, 4.0], np.float32)
    filled = driver_ranges(angles, distances, SENSITIVITY)[::-1]
    expected = {30: 1.0, 31: 2.0, 32: 2.0, 33: 2.0, 90: 3.0, 91: 3.0, 92: 3.0, 1079: 4.0}
    assert {int(k): filled[k] for k in np.flatnonzero(np.isfinite(filled))} == expected
    alone = driver_ranges(angles, distances, STANDARD)[::-1]
    assert {int(k): alone[k] for k in np.flatnonzero(np.isfinite(alone))} == {
        10: 2.0, 30: 3.0, 359: 4.0,
    }  # fmt: skip


def test_at_8_khz_nearly_every_bin_has_a_sample_of_its_own():
    angles = sample_angles(SENSITIVITY, 0.3)
    distances = np.arange(1, 1035, dtype=np.float32) / 1000 + 1
    ranges = driver_ranges(angles, distances, SENSITIVITY)
    seen = ranges[np.isfinite(ranges)]
    hidden = sum(2 * half for _, half in BLIND_SECTORS_DEG) / 360
    assert len(seen) / 1080 == pytest.approx(1 - hidden, abs=0.01)
    assert len(np.unique(seen)) / len(seen) == pytest.approx(1034 / 1080, abs=0.015)


def test_a_lost_sample_shows_what_the_one_before_it_saw():
    angles = sample_angles(SENSITIVITY, 0.5)
    distances = np.full(1034, 2.0, np.float32)
    distances[100:102] = (1.5, np.inf)
    ranges = driver_ranges(angles, distances, SENSITIVITY)
    assert np.count_nonzero(ranges == 1.5) in (2, 3)
    assert np.array_equal(np.isinf(ranges), np.isinf(turn(SENSITIVITY)))


def test_at_2_khz_a_quarter_of_the_bins_is_empty_and_never_two_together():
    ranges = turn(STANDARD, phase=0.2)
    assert len(ranges) == 360
    empty = np.isinf(ranges)
    away = np.min([np.abs((announced_deg(STANDARD) - b + 180) % 360 - 180) - half
                   for b, half in BLIND_SECTORS_DEG], axis=0) > 2  # fmt: skip
    assert empty[away].mean() == pytest.approx(91 / 360, abs=0.02)
    assert not (empty & np.roll(empty, 1) & away & np.roll(away, 1)).any()


@BOTH
@pytest.mark.parametrize("phase", [0.0, 0.37, 0.99])
def test_bins_show_what_lies_up_to_a_degree_to_the_right(mode, phase):
    angles = sample_angles(mode, phase)
    true = np.degrees(bearings(angles))
    for k in range(len(angles)):
        distances = np.full(len(angles), np.inf, np.float32)
        distances[k] = 2.0
        found = np.flatnonzero(np.isfinite(driver_ranges(angles, distances, mode)))
        if not len(found):
            continue  # behind a post
        own = announced_deg(mode)[found[-1]]  # the others are copies further to the right
        off = (own - true[k] + 180) % 360 - 180
        assert -0.01 <= off <= 1.0


@BOTH
def test_posts_and_bracket_hide_their_sectors(mode):
    ranges = turn(mode)
    for bearing in (58, -58, 112, -112, 180):
        assert ranges[bin_at(mode, bearing)] == np.inf
    for bearing in (0, 50, -50, 70, 100, -100, 120, 170, -170):
        about = ranges[bin_at(mode, bearing) - 1 :][:3]
        assert np.count_nonzero(about == 2.0) >= 2


@BOTH
@pytest.mark.parametrize(
    ("distance", "published"),
    [(0.149, np.inf), (0.151, 0.151), (11.9, 11.9), (12.1, np.inf), (np.inf, np.inf)],
)
def test_too_near_and_too_far_are_no_return(mode, distance, published):
    ranges = turn(mode, distance)
    assert ranges.dtype == np.float32
    assert ranges.min() == np.float32(published)


def test_a_turn_begins_at_the_robots_right_and_goes_clockwise():
    assert np.degrees(bearings(np.array([0.0, 90.0, 270.0]))) == pytest.approx([270, 180, 0])
    assert math.isclose(np.diff(sample_angles(STANDARD, 0.5))[0], 360 / 269)
