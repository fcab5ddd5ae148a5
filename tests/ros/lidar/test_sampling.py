"""The estimate is the same however a driver samples a turn; a sparse one is said to be DEGRADED."""

import math

import numpy as np
import pytest
from cfnav_ros.lidar.estimate import SweptDisc, Verdict, estimate_collision
from cfnav_ros.lidar.returns import _surfaces, look
from cfnav_ros.lidar.scan_watch import LidarParameters, ScanWatch
from cfnav_ros.lidar.sweep import NOMINAL
from sim_bridge.robot.noise import Noise, NoiseLevels
from sim_bridge.robot.rplidar import SENSITIVITY, STANDARD

from tests.ros.lidar_scans import noisy, replaced, room, sampled, scan_of, wall_ahead

DISC = SweptDisc()
MARGINAL = DISC.step + DISC.radius
"""A wall here in base_link is touched at the very end of a MoveAhead, or not."""


def mean_probability(scans):
    return float(np.mean([estimate_collision(scan).probability for scan in scans]))


@pytest.mark.parametrize("off", [-0.003, 0.0, 0.004])
def test_how_a_turn_is_sampled_does_not_move_the_probability(off):
    """Three copies of 360 returns, 1034 samples and 269 ones of one noisy wall say the same.

    Taken for as many returns as there are bins, 1034 samples said 0.10 more.
    """
    wall, rng = wall_ahead(MARGINAL + off), np.random.default_rng(0)
    copied = mean_probability(noisy(scan_of(wall), rng, 0.006) for _ in range(150))
    for mode in (SENSITIVITY, STANDARD):
        noise = Noise(NoiseLevels(range_share=0.006, dropout=0.0, edge_ghost=0.0), 0)
        said = mean_probability(sampled(wall, mode, noise) for _ in range(150))
        assert said == pytest.approx(copied, abs=0.045), mode.name


@pytest.mark.parametrize("mode", [SENSITIVITY, STANDARD])
def test_a_wall_is_where_it_is(mode):
    noise = Noise(NoiseLevels(), 1)
    for x in (0.3, 0.6, 1.0):
        clearances = [
            estimate_collision(sampled(wall_ahead(x), mode, noise)).clearance for _ in range(40)
        ]
        assert np.mean(clearances) == pytest.approx(x - DISC.radius - DISC.margin, abs=0.012 * x)


def test_a_scan_at_2_khz_is_usable_and_said_to_be_degraded():
    noise = Noise(NoiseLevels(), 0)
    fine = [estimate_collision(sampled(room, SENSITIVITY, noise)) for _ in range(50)]
    coarse = [estimate_collision(sampled(room, STANDARD, noise)) for _ in range(50)]
    assert {one.verdict for one in fine} == {Verdict.GOOD}
    assert {one.verdict for one in coarse} == {Verdict.DEGRADED}
    assert max(one.probability for one in coarse) < NOMINAL.unseen_near
    assert 0.65 < np.mean([one.known_fraction for one in coarse]) < 0.78
    assert max(one.unknown_arc for one in coarse) < DISC.good_arc_deg
    assert "of the forward beams return" in coarse[0].reason


@pytest.mark.parametrize("mode", [SENSITIVITY, STANDARD])
@pytest.mark.parametrize("bearing0", np.radians([-30.0, -13.3, 0.0, 7.7, 30.0]))
def test_a_chair_leg_close_by_blocks_the_way_at_once(mode, bearing0):
    """2 cm wide at 0.25 m: four degrees, in which 2 kHz have three samples and an empty bin."""

    def leg(bearing):
        return 0.25 if abs(bearing - bearing0) < math.radians(2.3) else room(bearing)

    parameters = LidarParameters(mount="parameters", frame="")
    noise = Noise(NoiseLevels(dropout=0.0, edge_ghost=0.0), 0)
    for k in range(10):
        watch = ScanWatch(0.4, 1.0, parameters.mounting(True), DISC, NOMINAL)
        watch.scan(10.13, 10.0, sampled(room, mode, noise))
        estimate, _ = watch.scan(10.26, 10.13, sampled(leg, mode, noise))
        assert estimate.probability > 0.95, (mode.name, k)


def test_a_sample_out_of_the_air_is_left_out_at_either_rate():
    for mode in (SENSITIVITY, STANDARD):
        clear = sampled(room, mode)
        step = math.degrees(clear.angle_increment)
        ghostly = replaced(clear, 0.2, -0.5 * step, 0.49 * step)
        assert np.count_nonzero(ghostly.ranges != clear.ranges) == 1
        seen = look(ghostly, DISC.mount, (), 0.0, DISC.radius, clear.ranges)
        assert seen.ghosts == 1
        kept = look(ghostly, DISC.mount, (), 0.0, DISC.radius, ghostly.ranges)
        assert (kept.ghosts, kept.ranges.min()) == (0, pytest.approx(0.2))


def surfaces(degrees, values):
    begins, ends, smooth = _surfaces(np.radians(degrees), np.array(values, float))
    return begins.tolist(), ends.tolist(), smooth.tolist()


def test_surfaces_by_hand():
    # A degree apart: a step of 9 % is a slanted wall, one of 12 % is another thing.
    begins, ends, smooth = surfaces([0.0, 1.0, 2.0, 3.0], [1.0, 1.09, 1.09, 1.25])
    assert begins == [True, False, False, True]
    assert ends == [False, False, True, True]
    assert smooth == pytest.approx([1.0, (1.0 + 2 * 1.09 + 1.09) / 4, 1.09, 1.25])
    # A third of a degree apart a wall of the same slant steps by a third of it, noise by more.
    assert surfaces([0.0, 0.33], [1.0, 1.048])[0] == [True, False]
    assert surfaces([0.0, 0.33], [1.0, 1.06])[0] == [True, True]
    # Over an empty bin, and over more than that.
    assert surfaces([0.0, 2.0], [1.0, 1.0])[0] == [True, False]
    assert surfaces([0.0, 3.0], [1.0, 1.0])[0] == [True, True]
    assert surfaces([], []) == ([], [], [])
    assert surfaces([5.0], [2.0]) == ([True], [True], [2.0])


@pytest.mark.parametrize(
    ("step", "weights"),
    [(0.3333, (0.5, 1, 1, 1, 1, 1, 0.5)), (1.0, (1, 2, 1)), (2.0, (1, 6, 1))],
)
def test_returns_are_averaged_over_the_same_arc_by_hand(step, weights):
    """The mean of straight lines over a degree to each side."""
    degrees, middle = np.arange(41) * step, 20
    values = np.full(41, 1.0)
    for k, weight in enumerate(weights):
        values[:] = 1.0
        values[middle] = 1.001
        at = middle + k - len(weights) // 2
        smooth = surfaces(degrees, values)[2][at]
        assert smooth - 1.0 == pytest.approx(0.001 * weight / sum(weights), rel=2e-3)


def test_a_corner_is_cut_alike_however_many_returns_there_are():
    for step in (0.25, 0.5, 1.0):
        degrees = np.arange(-10.0, 10.1, step)
        smooth = np.array(surfaces(degrees, 1.0 + 0.02 * np.abs(degrees))[2])
        assert smooth.min() == pytest.approx(1.0 + 0.02 / 2, abs=1e-6)


def test_a_slanted_wall_stays_where_it_is_beside_empty_bins():
    degrees = np.array([0.0, 1.0, 2.0, 4.0, 5.0, 6.0, 8.0])
    assert surfaces(degrees, 1.0 + 0.02 * degrees)[2] == pytest.approx(1.0 + 0.02 * degrees)
