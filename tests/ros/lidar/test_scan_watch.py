"""Scans in time and from where: each way of not seeing is BLIND, within its limit."""

import dataclasses
import math

import numpy as np
import pytest
from cfnav_ros.lidar.estimate import SweptDisc, Verdict, estimate_collision
from cfnav_ros.lidar.mounting import SEEN_THROUGH, Mounting, OwnParts
from cfnav_ros.lidar.scan_watch import NEW_S, LidarParameters, ScanWatch
from cfnav_ros.lidar.sweep import NOMINAL
from cfnav_ros.robot.speakers import Speaker

from tests.ros.lidar_scans import behind_posts, noisy, replaced, room, scan_of, wall_ahead

STALE_S, FROZEN_S, PERIOD_S = 0.4, 1.0, 0.13
DISC = SweptDisc()
SCAN = behind_posts(scan_of(room))


def watch_of(source="auto", given=False, frame="rplidar_link", frozen=FROZEN_S):
    mounting = Mounting(source, DISC.mount, given, "base_link", frame)
    return ScanWatch(STALE_S, frozen, mounting, DISC, NOMINAL), mounting


def drive(watch, scans, start=100.0):
    """Estimates of scans that arrive when their turn is over; the stamp is its beginning."""
    stamps = (start + k * PERIOD_S for k in range(1_000_000))
    return [watch.scan(t + PERIOD_S, t, scan)[0] for t, scan in zip(stamps, scans, strict=False)]


def stream(count, base=SCAN, seed=0):
    rng = np.random.default_rng(seed)
    return [noisy(base, rng) for _ in range(count)]


def test_a_fresh_scan_is_judged():
    watch, _ = watch_of()
    assert watch.scan(10.1, 10.0, SCAN) == (estimate_collision(SCAN), True)
    assert watch.silence(10.45) is None
    assert watch.age(10.45) == pytest.approx(0.35)  # of what had ended when it arrived


def test_a_stream_of_good_scans_stays_good():
    watch, _ = watch_of()
    assert {e.verdict for e in drive(watch, stream(100))} == {Verdict.GOOD}


@pytest.mark.parametrize(("lost", "seen"), [(0, True), (1, True), (2, True), (3, False)])
@pytest.mark.parametrize("late", [0.0, 0.009])
def test_two_lost_scans_are_bridged_and_three_are_blind(lost, seen, late):
    """The stamp is the beginning of a turn, the age counts from its end."""
    watch, _ = watch_of()
    watch.scan(10.0 + PERIOD_S, 10.0, SCAN)
    next_one = 10.0 + PERIOD_S * (2 + lost) + late
    assert (watch.silence(next_one) is None) is seen


@pytest.mark.parametrize(
    ("taken", "from_stamp"),
    [(0.13, 0.53), (0.0, 0.4), (-1.0, 0.4), (math.nan, 0.4), (math.inf, 0.4), (5.0, 0.6)],
)
def test_only_a_sensible_scan_time_makes_a_scan_younger(taken, from_stamp):
    scan = dataclasses.replace(SCAN, scan_time=taken)
    for age, fresh in ((from_stamp - 0.01, True), (from_stamp + 0.01, False)):
        watch, _ = watch_of()
        estimate, timely = watch.scan(10.0 + age, 10.0, scan)
        assert (estimate.verdict is Verdict.GOOD, timely) == (fresh, fresh)


@pytest.mark.parametrize("stamp", [10.0, 10.3])
def test_a_scan_ended_at_the_latest_when_it_arrived(stamp):
    """Neither its scan_time nor a stamp ahead of node time keeps the robot seeing for longer."""
    watch, _ = watch_of()
    watch.scan(10.0, stamp, SCAN)
    assert watch.silence(10.39) is None
    assert watch.silence(10.41) is not None


def test_silence_is_blind():
    watch, _ = watch_of()
    assert watch.silence(5.0).reason == "No scan has arrived."
    watch.scan(10.0, 10.0, SCAN)
    blind = watch.silence(10.41)
    assert (blind.verdict, blind.probability, blind.clearance) == (Verdict.BLIND, 1.0, 0.0)
    assert blind.reason == "The newest scan is 0.41 s old."
    assert watch.scan(10.6, 10.55, SCAN)[0].verdict is Verdict.GOOD
    assert watch.silence(10.7) is None


@pytest.mark.parametrize("late", [0.54, 1.0, 5.0, 1e6])
def test_a_late_scan_is_blind(late):
    estimate, timely = watch_of()[0].scan(1e6, 1e6 - late, SCAN)
    assert (estimate.verdict, timely) == (Verdict.BLIND, False)


def test_a_scan_from_the_future_is_blind():
    watch, _ = watch_of()
    estimate, timely = watch.scan(10.0, 12.0, SCAN)
    assert (estimate.reason, timely) == ("The scan is stamped 2.0 s in the future.", False)
    assert watch.silence(10.0) is not None  # it does not count as seen


@pytest.mark.parametrize(("stamp", "word"), [(10.0, "repeats"), (9.9, "is older than")])
def test_a_stamp_that_does_not_go_on_is_blind_at_once(stamp, word):
    watch, _ = watch_of()
    watch.scan(10.0, 10.0, SCAN)
    estimate, timely = watch.scan(10.1, stamp, SCAN)
    assert (estimate.verdict, timely) == (Verdict.BLIND, False)
    assert estimate.reason == f"The scan's stamp {word} that of the scan before."
    assert watch.silence(10.5) is not None  # nor does it keep the robot seeing


def test_a_clock_that_starts_again_is_followed():
    watch, _ = watch_of()
    watch.scan(100.0, 100.0, SCAN)
    assert watch.silence(1.0).reason == "The newest scan is -99.00 s old."
    assert watch.scan(1.0, 1.0, SCAN)[0].verdict is Verdict.GOOD


def test_ranges_that_never_change_are_blind_after_a_second():
    watch, _ = watch_of()
    verdicts = [e.verdict for e in drive(watch, [SCAN] * 20)]
    first = verdicts.index(Verdict.BLIND)
    assert FROZEN_S < first * PERIOD_S <= FROZEN_S + 2 * PERIOD_S
    assert set(verdicts[first:]) == {Verdict.BLIND}
    (after,) = drive(watch, stream(1), start=200.0)
    assert after.verdict is Verdict.GOOD
    noiseless, _ = watch_of(frozen=0.0)
    assert {e.verdict for e in drive(noiseless, [SCAN] * 20)} == {Verdict.GOOD}


def test_two_publishers_are_blind_and_named():
    watch, _ = watch_of()
    driver, rival = Speaker(b"1", "rplidar"), Speaker(b"2", "rival")
    watch.publishers(0.0, [driver, rival])
    (estimate,) = drive(watch, [SCAN])
    assert estimate.verdict is Verdict.BLIND
    assert "2 nodes publish scans (rival, rplidar)" in estimate.reason
    watch.publishers(0.5 * NEW_S, [driver])
    assert drive(watch, stream(1), 150.0)[0].verdict is Verdict.BLIND
    watch.publishers(NEW_S, [driver])
    assert drive(watch, stream(1), 200.0)[0].verdict is Verdict.GOOD


def test_a_new_publisher_is_blind_for_a_while_whatever_its_name():
    watch, _ = watch_of()
    watch.publishers(0.0, [Speaker(b"1", "rplidar")])
    assert drive(watch, [SCAN])[0].verdict is Verdict.GOOD
    watch.publishers(10.0, [Speaker(b"2", "rplidar")])
    (estimate,) = drive(watch, stream(1), 200.0)
    reason = "rplidar publishes scans now, in place of another one."
    assert (estimate.verdict, estimate.reason) == (Verdict.BLIND, reason)
    watch.publishers(10.0 + NEW_S, [Speaker(b"2", "rplidar")])
    assert drive(watch, stream(1), 300.0)[0].verdict is Verdict.GOOD


def test_a_scanner_that_nobody_described_is_blind_until_somebody_does():
    for frame, given, sees in (
        ("rplidar_link", False, True), ("laser", False, False), ("laser", True, True),
    ):  # fmt: skip
        mounting = LidarParameters(frame=frame).mounting(given)
        watch = ScanWatch(STALE_S, FROZEN_S, mounting, DISC, NOMINAL)
        (estimate,) = drive(watch, [dataclasses.replace(SCAN, frame=frame)])
        assert (estimate.verdict is not Verdict.BLIND) is sees
        if not sees:
            assert estimate.reason.startswith("Nobody says where the LiDAR of frame 'laser' sits")


def test_another_frame_is_blind():
    other = dataclasses.replace(SCAN, frame="oakd_link")
    (estimate,) = drive(watch_of()[0], [other])
    assert estimate.verdict is Verdict.BLIND
    assert "from frame 'oakd_link', expected 'rplidar_link'" in estimate.reason
    assert drive(watch_of(frame="")[0], [other])[0].verdict is Verdict.GOOD


@pytest.mark.parametrize(
    "change",
    [
        {"ranges": np.full(1080, math.inf, np.float32)},
        {"ranges": np.full(1080, math.nan, np.float32)},
        {"ranges": np.zeros(1080, np.float32)},
        {"ranges": np.linspace(0.09, 0.11, 1080, dtype=np.float32)},
        {"ranges": np.zeros(0, np.float32)},
        {"ranges": np.ones(1, np.float32)},
        {"ranges": SCAN.ranges[:700]},
        {"ranges": np.zeros(30_000, np.float32)},
        {"angle_increment": 0.0},
        {"angle_increment": -SCAN.angle_increment},
        {"angle_increment": math.nan},
        {"angle_increment": 2 * SCAN.angle_increment},
        {"angle_increment": 2 * SCAN.angle_increment, "angle_max": math.pi + math.radians(359)},
        {"range_min": 12.0, "range_max": 0.15},
    ],
)
def test_a_scan_that_says_nothing_is_blind_at_once_and_forgiven_at_once(change):
    good = stream(3)
    bad = dataclasses.replace(SCAN, **change)
    before, blind, after = drive(watch_of()[0], [good[0], bad, good[1]])
    assert (before.verdict, after.verdict) == (Verdict.GOOD, Verdict.GOOD)
    assert (blind.verdict, blind.probability, blind.clearance) == (Verdict.BLIND, 1.0, 0.0)
    assert blind.reason.endswith(".")
    assert {other.verdict for other in blind.others} == {Verdict.BLIND}


# Ghosts: single near returns that only one scan has


def ghosts(rng, count):
    """Scans with one return (of three bins) at 0.2 m at a drawn bearing ahead."""
    for scan in stream(count, seed=1):
        at = 270 + 3 * int(rng.integers(-13, 13))
        ranges = scan.ranges.copy()
        ranges[at : at + 3] = 0.2
        yield dataclasses.replace(scan, ranges=ranges)


def test_a_ghost_does_not_block_the_way_but_is_told():
    ghostly = next(ghosts(np.random.default_rng(0), 1))
    before, estimate = drive(watch_of()[0], [*stream(1), ghostly])
    assert before.verdict is Verdict.GOOD
    assert estimate.verdict is Verdict.DEGRADED
    assert estimate.probability < 0.1
    assert "1 lone near returns are left out" in estimate.reason


def test_something_thin_that_stays_does_block_the_way():
    def thin(scan):
        ranges = scan.ranges.copy()
        ranges[270:273] = 0.25
        return dataclasses.replace(scan, ranges=ranges)

    first, second, third = stream(3)
    _, once, twice = drive(watch_of()[0], [first, thin(second), thin(third)])
    assert once.probability < 0.1
    assert twice.probability > 0.99


def test_something_near_and_not_thin_blocks_the_way_at_once():
    leg = replaced(SCAN, 0.25, -2, 2)
    _, estimate = drive(watch_of()[0], [SCAN, leg])
    assert estimate.probability > 0.99


# The robot's own parts


def test_a_turned_scanner_is_found_by_the_robots_own_posts():
    turned = behind_posts(scan_of(wall_ahead(2.0)), turned_deg=90)
    estimates = drive(watch_of()[0], stream(30, turned))
    assert {e.verdict for e in estimates} == {Verdict.BLIND}
    assert "own parts: it is not mounted as said" in estimates[0].reason


@pytest.mark.parametrize("turned_deg", [10, 30, 90, 150, -45, 180])
def test_every_turn_beyond_a_posts_width_is_found(turned_deg):
    parts = OwnParts(DISC.mask_bearings, DISC.radius)
    turned = behind_posts(scan_of(room), turned_deg)
    assert all(parts.look(scan, DISC.mount) for scan in stream(SEEN_THROUGH, turned))


def test_a_scanner_that_is_turned_on_the_way_is_found_after_some_scans():
    """Before that its parts were seen, so that one scan through them may be a ghost's."""
    parts = OwnParts(DISC.mask_bearings, DISC.radius)
    assert not any(parts.look(scan, DISC.mount) for scan in stream(SEEN_THROUGH))
    turned = behind_posts(scan_of(room), turned_deg=90)
    sentences = [parts.look(scan, DISC.mount) for scan in stream(SEEN_THROUGH, turned)]
    assert bool(sentences[-1])
    assert not any(sentences[:-1])


def test_a_scanner_that_turns_the_wrong_way_is_found():
    """Mirrored about the laser's own axis, which points left: front and rear are swapped."""
    parts = OwnParts(DISC.mask_bearings, DISC.radius)
    for scan in stream(SEEN_THROUGH):
        mirrored = dataclasses.replace(scan, ranges=np.roll(scan.ranges[::-1], -3))
        sentence = parts.look(mirrored, DISC.mount)
    assert "it is not mounted as said" in sentence


def test_a_few_ghosts_behind_posts_are_no_turn():
    parts, rng = OwnParts(DISC.mask_bearings, DISC.radius), np.random.default_rng(3)
    for scan in stream(200):
        ranges = scan.ranges.copy()
        ghost = np.repeat(rng.random(360) < 0.2, 3) & np.isinf(ranges)
        ranges[ghost] = 1.0
        assert parts.look(dataclasses.replace(scan, ranges=ranges), DISC.mount) == ""


def test_parts_that_return_from_within_the_hull_are_not_seen_through():
    """By hand: 0.17 m from the LiDAR no post's bearing has left the hull, 0.25 m all have."""
    for at, fault in ((0.17, False), (0.25, True)):
        parts = OwnParts((math.radians(58.3), math.radians(-58.3)), DISC.radius)
        mast = replaced(replaced(scan_of(room), at, 54, 62), at, -62, -54)
        sentences = [parts.look(scan, DISC.mount) for scan in stream(SEEN_THROUGH, mast)]
        assert bool(sentences[-1]) is fault


def test_a_robot_without_parts_has_none_to_look_for():
    parts = OwnParts((), DISC.radius)
    assert not any(parts.look(scan, DISC.mount) for scan in stream(30, scan_of(room)))


def test_the_step_that_is_judged_is_the_one_that_is_driven():
    with pytest.raises(ValueError, match=r"disc\.step is 0\.1, expected 0\.25, which a MoveAhead"):
        LidarParameters(disc=SweptDisc(step=0.1))
