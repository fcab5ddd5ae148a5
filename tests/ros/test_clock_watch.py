"""How long node time may stand still."""

import pytest
from cfnav_ros.clock_watch import ClockWatch, Standstill

RUNNING_NS = 5_000_000_000


@pytest.fixture
def watch():
    """Node time has just moved to ``RUNNING_NS``, at 100 s of real time."""
    watch = ClockWatch(timeout=2.0, start_timeout=10.0)
    watch.restart(99.9)
    assert watch.look(100.0, RUNNING_NS) is Standstill.NONE
    return watch


@pytest.mark.parametrize(
    ("stood", "expected"),
    [
        (0.4, Standstill.NONE),
        (0.6, Standstill.STOP),
        (1.9, Standstill.STOP),
        (2.1, Standstill.FAIL),
        (2.6, Standstill.END),
    ],
)
def test_the_longer_it_stands_the_more_it_asks_for(watch, stood, expected):
    assert watch.look(100.0 + stood, RUNNING_NS) is expected


def test_time_that_runs_is_never_told_off(watch):
    for tick in range(1, 200):
        assert watch.look(100.0 + 0.4 * tick, RUNNING_NS + tick) is Standstill.NONE


def test_time_that_moves_again_starts_anew(watch):
    assert watch.look(102.6, RUNNING_NS) is Standstill.END
    assert watch.look(102.7, RUNNING_NS + 1) is Standstill.NONE
    assert watch.look(103.3, RUNNING_NS + 1) is Standstill.STOP


def test_time_that_jumps_back_runs(watch):
    assert watch.look(103.0, RUNNING_NS - 1) is Standstill.NONE


def test_time_that_has_not_begun_is_waited_for_longer():
    watch = ClockWatch(timeout=2.0, start_timeout=10.0)
    watch.restart(100.0)
    looks = [watch.look(100.0 + stood, 0) for stood in (0.4, 9.9, 10.1, 10.6)]
    assert looks == list(Standstill)


def test_a_new_episode_does_not_inherit_the_standing_of_the_pause(watch):
    watch.restart(160.0)
    assert watch.look(160.4, RUNNING_NS) is Standstill.NONE
    assert watch.look(160.6, RUNNING_NS) is Standstill.STOP
