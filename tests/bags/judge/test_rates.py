"""Touches in odometry with noise, of low rates, and from slow commands: found, or unknown."""

import dataclasses

import pytest
from cfnav_ros.bags.files.events import Pose
from cfnav_ros.bags.judge.block_stalls import VISIBLE_S
from cfnav_ros.bags.judge.contacts import BUMP, STALL
from cfnav_ros.bags.judge.drives import DriveFinder
from cfnav_ros.bags.judge.outcomes import judge

from tests.bags.made import bumps, recorded

REST = (1.0, 0.0, 0.0, 0.0, 0.0)
GO = (3.0, 0.2, 0.0, 0.2, 0.0)
PUSH = (3.0, 0.2, 0.0, 0.0, 0.0)
BACK = (1.5, -0.2, 0.0, -0.2, 0.0)
WALL, FREE = (REST, GO, PUSH, REST, REST), (REST, GO, GO, REST, REST)


def judged(events):
    finder = DriveFinder()
    (only,) = [d for event in events for d in finder.see(event)] + finder.finish()
    return judge(only)


SEEN = [
    {"odometry": 100 / 30},
    {"odometry": 5},
    {"odometry": 100},
    {"commands": 1},
    {"commands": 2},
    {"odometry": 100, "sigma": 0.001},
    {"sigma": 0.002},
    {"sigma": 0.005},
    {"odometry": 100, "sigma": 0.01},
    {"heading": 0.005},
    {"odometry": 5, "commands": 1, "sigma": 0.001},
]


@pytest.mark.parametrize("how", SEEN)
@pytest.mark.parametrize(("parts", "touches", "metres"), [(WALL, 1, 0.6), (FREE, 0, 1.2)])
def test_touches_and_ways_within_the_working_range(how, parts, touches, metres):
    for seed in range(3 if "sigma" in how or "heading" in how else 1):
        found = judged(recorded(*parts, **how, seed=seed))
        assert (found.collisions.value, found.collisions.why) == (touches, "")
        assert found.path_length_m.value == pytest.approx(metres, rel=0.05)


@pytest.mark.parametrize(
    ("how", "sentence"),
    [
        ({"odometry": 100 / 33}, "only stalls of 1.0 s or more"),
        ({"odometry": 1}, "only stalls of 3.0 s or more"),
        ({"odometry": 2}, "only stalls of 1.5 s or more"),
        ({"odometry": 2, "sigma": 0.05}, "shows no stall"),
        ({"sigma": 0.02}, "jitters by"),
    ],
)
def test_no_touch_is_unknown_where_a_touch_might_not_show(how, sentence):
    found = judged(recorded(*FREE, **how))
    assert found.collisions.value is None
    assert sentence in found.collisions.why
    assert STALL not in found.collisions_by
    assert found.collisions_per_m.value is None


def test_a_long_touch_that_slow_odometry_shows_counts_but_says_what_would_not_show():
    found = judged(recorded(*WALL, odometry=2))
    assert found.collisions.value == 1
    assert "only stalls of 1.5 s" in found.collisions.why


@pytest.mark.parametrize(
    "how",
    [
        {"odometry": 100 / 30},
        {"odometry": 5},
        {"sigma": 0.002},
        {"sigma": 0.005},
        {"odometry": 100, "sigma": 0.01},
    ],
)
def test_the_shortest_stall_within_the_range_is_seen_whenever_it_begins(how):
    values = []
    for seed in range(10):
        go = (2.0 + 0.03 * seed, 0.2, 0.0, 0.2, 0.0)
        push = (VISIBLE_S, 0.2, 0.0, 0.0, 0.0)
        found = judged(recorded(REST, go, push, REST, GO, REST, **how, seed=seed))
        values.append(found.collisions.value)
    assert set(values) <= {1, None}  # noise that seems a little larger leaves it unknown
    assert values.count(1) >= 9


def test_a_bumper_tells_of_touches_whatever_the_odometry():
    reports = [bumps(100 + i / 10, *["front"] * (i == 50)) for i in range(100)]
    events = sorted([*recorded(*FREE, odometry=1), *reports], key=lambda e: e.t_ns)
    assert judged(events).collisions_by[BUMP] == judged(events).collisions.value == 1


def test_a_base_that_forgets_its_command_before_the_next_has_unknown_touches():
    spurt = ((0.5, 0.2, 0.0, 0.2, 0.0), (0.5, 0.2, 0.0, 0.0, 0.0))
    events = recorded(REST, *spurt * 6, REST, commands=1)
    found = judged(events)
    assert found.collisions.value is None
    assert "commands come every 1.0 s" in found.collisions.why
    # The same motion under steady commands are six touches.
    assert judged(recorded(REST, *spurt * 6, REST)).collisions.value > 1


def test_a_few_poses_do_not_tell_noise_from_motion():
    found = [judged(recorded(*WALL, odometry=2, sigma=0.01, seed=seed)) for seed in range(8)]
    assert all(f.collisions.value is None for f in found)
    assert any(f.path_length_m.why.startswith("too few poses") for f in found)
    told = [f.path_length_m.value for f in found if f.path_length_m.known]
    assert told == pytest.approx([0.6] * len(told), abs=0.1)


@pytest.mark.parametrize("hz", [10 / 3, 5, 7])
def test_one_late_pose_is_no_touch_at_a_low_rate(hz):
    events = recorded(*FREE, odometry=100 / round(100 / hz))
    poses = [n for n, event in enumerate(events) if isinstance(event, Pose)]
    late, before = poses[len(poses) // 2], poses[len(poses) // 2 - 1]
    x = events[before].x + 1e-4  # not to the last bit, as of a driver that is frozen
    events[late] = dataclasses.replace(events[late], x=x)
    assert judged(events).collisions.value == 0


@pytest.mark.parametrize("seed", range(3))
def test_each_of_two_touches_counts_in_noise(seed):
    found = judged(
        recorded(REST, GO, PUSH, REST, BACK, REST, GO, PUSH, REST, sigma=0.005, seed=seed)
    )
    assert found.collisions.value == 2


def test_a_long_push_in_much_noise_is_one_touch():
    found = judged(recorded(REST, GO, *[PUSH] * 8, REST, sigma=0.015))
    assert found.collisions.value == 1
    assert "only stalls of" in found.collisions.why


@pytest.mark.parametrize("seed", [24, 25, 30])  # whose noise goes 5 mm ahead at once
def test_noise_does_not_start_a_base_that_stands(seed):
    found = judged(recorded(REST, PUSH, PUSH, REST, sigma=0.005, seed=seed))
    assert found.collisions.value == 0
    assert any("never started" in note for note in found.notes)


@pytest.mark.parametrize("seed", range(3))
def test_a_base_that_backs_off_in_noise_has_touched(seed):
    reflex = ((0.2, 0.0, 0.0, 0.0, 0.0), (0.7, 0.0, 0.0, -0.14, 0.0))
    found = judged(recorded(REST, GO, *reflex, REST, REST, sigma=0.002, seed=seed))
    assert found.collisions.value == 1
