"""What odometry tells of itself: its jitter, its way, and whether two sources speak."""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from cfnav_ros.bags.judge.contacts import STALL
from cfnav_ros.bags.judge.drives import DriveFinder
from cfnav_ros.bags.judge.odometry import BLOCKS_S, Blocks, Jitter, OdometryQuality, OneOdometry
from cfnav_ros.bags.judge.way import TWO_SOURCES, Way

from tests.bags.made import drive, ns, pose

SAMPLES = 400
TIMES = 100 + np.arange(SAMPLES) / 20
MOVE = (1.0, 0.2, 0.0, 0.2, 0.0)
REST = (1.0, 0.0, 0.0, 0.0, 0.0)


def jitter_of(x, y, times=TIMES):
    jitter = Jitter(2)
    for t, a, b in zip(times, x, y, strict=True):
        jitter.take(t, a, b)
    return jitter


def quality_of(poses):
    quality = OdometryQuality()
    for p in poses:
        quality.take(p.t_ns, p)
    return quality


def way_of(poses):
    way = Way()
    for p in poses:
        way.take(p.t_ns, p)
    return way.length(quality_of(poses))


def noisy(poses, sigma, seed=0):
    rng = np.random.default_rng(seed)
    return [
        dataclasses.replace(p, x=p.x + dx, y=p.y + dy)
        for p, (dx, dy) in zip(poses, rng.normal(0, sigma, (len(poses), 2)), strict=True)
    ]


def poses_of(*parts, **how):
    return [event for event in drive(100, *parts, **how) if hasattr(event, "yaw")]


@pytest.mark.parametrize("seed", range(5))
def test_jitter_is_the_spread_of_errors_drawn_anew_whatever_the_motion(seed):
    x, y = np.random.default_rng(seed).normal(0, 0.003, (2, SAMPLES))
    turn = 0.8 * TIMES
    x, y = x + 0.25 * np.cos(turn), y + 0.25 * np.sin(turn)
    assert jitter_of(x, y).sigma == pytest.approx(0.003, rel=0.25)


def test_slip_and_acceleration_are_no_jitter():
    slip = np.random.default_rng(1).normal(0.01, 0.002, (2, SAMPLES)).cumsum(axis=1)
    assert jitter_of(*slip).sigma < 0.0008
    swings = 0.1 * np.sin(4 * TIMES)
    assert jitter_of(swings, 0 * swings).sigma == 0.0


def test_stamps_that_come_unevenly_are_no_jitter():
    times = TIMES + np.random.default_rng(2).uniform(0, 0.03, SAMPLES)
    assert jitter_of(0.2 * times, 0 * times, times).sigma == 0.0


def test_a_base_that_repeats_its_pose_while_it_stands_still_jitters_when_it_drives():
    x, y = np.random.default_rng(3).normal(0, 0.003, (2, SAMPLES))
    x[: SAMPLES * 3 // 4] = y[: SAMPLES * 3 // 4] = 0.0
    assert jitter_of(x, y).sigma == pytest.approx(0.003, rel=0.35)


@pytest.mark.parametrize(
    ("hz", "sigma", "block_s"),
    [(20, 0.0, 0.0), (20, 0.0002, 0.0), (20, 0.0015, 0.15), (100, 0.001, 0.075), (2, 0.2, None)],
)
def test_blocks_are_as_long_as_the_noise_asks_for(hz, sigma, block_s):
    quality = quality_of(noisy(poses_of((20.0, 0.2, 0.0, 0.2, 0.0), hz=hz), sigma))
    assert quality.block_s == block_s
    assert quality.period == pytest.approx(1 / hz)


def test_a_heading_that_jitters_asks_for_blocks_too():
    rng = np.random.default_rng(4)
    poses = [pose(100 + i / 20, yaw=math.pi + rng.normal(0, 0.01)) for i in range(SAMPLES)]
    assert quality_of(poses).jitter_rad == pytest.approx(0.01, rel=0.25)
    assert quality_of(poses).block_s in BLOCKS_S


def test_a_block_has_the_mean_of_its_samples_at_their_mean_time():
    blocks = Blocks(0.2)
    yaws = (3.1, -3.1, 3.1, -3.1)
    samples = [pose(100 + i / 20, x=i, yaw=yaws[i % 4], v=0.1 * i) for i in range(5)]
    found = [blocks.take(p.t_ns, p) for p in samples]
    assert found[:4] == [None] * 4
    t_ns, mean = found[4]
    assert t_ns == ns(100.075)
    assert (mean.x, mean.v, abs(mean.yaw)) == pytest.approx((1.5, 0.15, math.pi))
    # Where stamps go back, what was begun belongs to nothing.
    back = pose(90, x=50)
    assert blocks.take(back.t_ns, back) is None
    assert blocks.take(ns(90.2), back)[1].x == 50


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("hz", "sigma"), [(100, 0.001), (20, 0.002), (20, 0.005), (20, 0.01)])
def test_noise_is_no_way(hz, sigma, seed):
    poses = noisy(poses_of(REST, *[MOVE] * 5, *[REST] * 4, hz=hz), sigma, seed)
    metres, about = way_of(poses)
    assert metres == pytest.approx(1.0, abs=0.05)
    assert "jitters by" in about


def test_a_drive_that_begins_and_ends_at_speed_is_not_cut_at_its_ends():
    metres, _ = way_of(noisy(poses_of(*[MOVE] * 5), 0.005))
    assert metres == pytest.approx(1.0, abs=0.04)


def test_a_robot_that_stands_makes_no_way():
    metres, _ = way_of(noisy(poses_of(*[REST] * 60), 0.005))
    assert metres < 0.03


def test_the_way_of_exact_odometry_is_that_of_its_steps():
    poses = poses_of(MOVE, REST, (4.0, 0.2, 0.8, 0.2, 0.8), (3.0, 0.02, 0.0, 0.02, 0.0))
    steps = sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(poses))
    assert way_of(poses) == (pytest.approx(steps, abs=1e-12), "")


def test_a_leap_is_no_way_of_noisy_odometry_either():
    first = noisy(poses_of(MOVE, REST), 0.005)
    second = [
        dataclasses.replace(p, t_ns=p.t_ns + ns(2), x=p.x + 5.0)
        for p in noisy(poses_of(MOVE, REST), 0.005, 1)
    ]
    metres, _ = way_of(first + second)
    assert metres == pytest.approx(0.4, abs=0.05)


def test_a_twist_that_tells_another_way_is_said():
    poses = poses_of(*[MOVE] * 3)
    assert way_of(poses)[1] == ""
    silent = [dataclasses.replace(p, v=0.0) for p in poses]
    metres, about = way_of(silent)
    assert metres == pytest.approx(0.59)
    assert about == "its poses say 0.59 m, its twist says 0.00 m: the poses count"


def offset(poses, x=0.0, y=0.0, late=0.0):
    return [dataclasses.replace(p, t_ns=p.t_ns + ns(late), x=p.x + x, y=p.y + y) for p in poses]


def together(*tracks):
    return sorted((p for track in tracks for p in track), key=lambda p: p.t_ns)


ROUTE = (REST, *[MOVE] * 4, REST)


@pytest.mark.parametrize(
    "second",
    [
        offset(poses_of(*ROUTE), y=1.0, late=0.025),
        offset(poses_of(*ROUTE), y=0.03, late=0.025),  # too near for a jump
        offset(poses_of(*ROUTE), y=0.03),  # at the same time
        offset(poses_of(*ROUTE, hz=7.0), x=-2.0, late=0.01),  # seldomer
        offset(poses_of(*ROUTE, hz=50.0), x=-2.0, late=0.01),
    ],
)
def test_two_sources_in_one_topic_are_told_and_make_no_way(second):
    assert way_of(together(poses_of(*ROUTE), second)) == (None, TWO_SOURCES)


def test_odometry_that_is_reset_is_one_source():
    poses = [*poses_of(*ROUTE), *offset(poses_of(*ROUTE), x=3.0, late=6.0)]
    poses += offset(poses_of(*ROUTE), late=12.0)
    metres, about = way_of(poses)
    assert (metres, about) == (pytest.approx(2.4, abs=0.03), "")


def test_two_sources_tell_of_no_touch():
    events = drive(100, *ROUTE, (2.0, 0.2, 0.0, 0.0, 0.0), REST)
    aside = [dataclasses.replace(e, y=e.y + 1.0) for e in events if hasattr(e, "yaw")]
    both = sorted([*events, *offset(aside, late=0.025)], key=lambda e: e.t_ns)
    finder = DriveFinder()
    found = [d for event in both for d in finder.see(event)] + finder.finish()
    (only,) = found
    assert (STALL in only.contacts, only.stalls_about) == (False, TWO_SOURCES)


def test_sources_with_other_frames_are_kept_apart():
    one = OneOdometry()
    kinds = ["odom to base_link", "visual to camera"] * 3
    poses = [dataclasses.replace(pose(100 + i), frames=kind) for i, kind in enumerate(kinds)]
    assert [one.takes(p) for p in poses] == [True, False] * 3
    (sentence,) = one.notes
    assert "odom to base_link (3 messages), visual to camera (3 messages)" in sentence
    assert OneOdometry().notes == []
