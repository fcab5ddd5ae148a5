"""How long node time may stand still."""

import pytest
from cfnav_ros.drive.clock_watch import Alarm, ClockWatch

RUNNING_NS = 5_000_000_000


@pytest.fixture
def watch():
    """Node time has just moved to ``RUNNING_NS``, at 100 s of real time."""
    watch = ClockWatch(timeout=2.0, start_timeout=10.0)
    watch.restart(99.9)
    assert watch.look(100.0, RUNNING_NS) is Alarm.NONE
    return watch


def stand(watch, real, seconds, read_ns=RUNNING_NS):
    """What the looks of some seconds from a real time on end with."""
    for tick in range(1, round(10 * seconds) + 1):
        alarm = watch.look(real + 0.1 * tick, read_ns)
    return alarm


@pytest.mark.parametrize(
    ("stood", "expected"),
    [
        (0.4, Alarm.NONE),
        (0.6, Alarm.STOP),
        (1.9, Alarm.STOP),
        (2.1, Alarm.FAIL),
        (2.6, Alarm.END),
    ],
)
def test_the_longer_it_stands_the_more_it_asks_for(watch, stood, expected):
    assert stand(watch, 100.0, stood) is expected


def test_a_process_that_stood_itself_does_not_blame_the_clock(watch):
    assert watch.look(103.0, RUNNING_NS) is Alarm.STOP
    assert watch.look(103.1, RUNNING_NS) is Alarm.NONE  # what came meanwhile is being read
    assert watch.look(103.2, RUNNING_NS + 3_000_000_000) is Alarm.NONE
    assert stand(watch, 103.2, 2.1, RUNNING_NS + 3_000_000_000) is Alarm.FAIL


def test_time_that_runs_is_never_told_off(watch):
    for tick in range(1, 200):
        assert watch.look(100.0 + 0.4 * tick, RUNNING_NS + tick) is Alarm.NONE


def test_time_that_moves_again_starts_anew(watch):
    assert stand(watch, 100.0, 2.6) is Alarm.END
    assert watch.look(102.7, RUNNING_NS + 1) is Alarm.NONE
    assert stand(watch, 102.7, 0.6, RUNNING_NS + 1) is Alarm.STOP


@pytest.mark.parametrize("back", [1, 10_000_000_000])
def test_time_that_jumps_back_fails_an_episode(watch, back):
    """Timers of a system clock that was set back stay silent: nothing else notices."""
    assert watch.look(100.1, RUNNING_NS - back) is Alarm.FAIL
    assert watch.reason == "Node time jumped back."
    assert watch.look(100.2, RUNNING_NS - back + 1) is Alarm.NONE


def test_time_that_has_not_begun_is_waited_for_longer():
    watch = ClockWatch(timeout=2.0, start_timeout=10.0)
    watch.restart(100.0)
    steps = ((100.0, 0.4), (100.4, 9.5), (109.9, 0.2), (110.1, 0.5))
    looks = [stand(watch, real, seconds, 0) for real, seconds in steps]
    assert looks == list(Alarm)


def test_a_new_episode_does_not_inherit_the_standing_of_the_pause(watch):
    watch.restart(160.0)
    assert stand(watch, 160.0, 0.4) is Alarm.NONE
    assert stand(watch, 160.4, 0.2) is Alarm.STOP


@pytest.mark.parametrize(("passed", "advance"), [(0.05, 10.0), (0.1, 6.0), (1.0, 24.0)])
def test_time_that_leaps_ahead_fails_an_episode(watch, passed, advance):
    assert watch.look(100.0 + passed, RUNNING_NS + int(advance * 1e9)) is Alarm.FAIL
    assert watch.reason == f"Node time leapt ahead by {advance:.1f} s: was the clock set?"


@pytest.mark.parametrize(("passed", "advance"), [(0.05, 1.0), (0.4, 8.0), (1.3, 1.3)])
def test_a_fast_simulation_or_a_stalled_process_is_no_leap(watch, passed, advance):
    assert watch.look(100.0 + passed, RUNNING_NS + int(advance * 1e9)) is Alarm.NONE


def test_time_may_be_anywhere_when_an_episode_or_time_itself_begins(watch):
    watch.restart(200.0)
    assert watch.look(200.1, RUNNING_NS + 10**12) is Alarm.NONE
    watch = ClockWatch(timeout=2.0, start_timeout=10.0)
    watch.restart(100.0)
    assert watch.look(100.1, 0) is Alarm.NONE
    assert watch.look(100.2, RUNNING_NS) is Alarm.NONE
