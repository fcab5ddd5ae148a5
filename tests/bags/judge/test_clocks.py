"""Bags whose stamps and log times come from two clocks."""

import dataclasses

import pytest
from cfnav_ros.bags.judge.contacts import STALL
from cfnav_ros.bags.judge.drives import DriveFinder

from tests.bags.made import drive, ns

MOVE = (1.0, 0.2, 0.0, 0.2, 0.0)


@pytest.mark.parametrize(("pace", "known"), [(1.0, True), (0.1, False), (4.0, False)])
def test_stalls_are_not_told_by_two_clocks_of_another_pace(pace, known):
    """A simulator's stamps in a bag whose log is the system's."""
    events = [
        dataclasses.replace(e, t_ns=e.t_ns, log_ns=ns(1e6) + round(e.t_ns / pace))
        for e in drive(101, *[MOVE] * 12)
    ]
    finder = DriveFinder()
    for event in sorted(events, key=lambda e: e.log_ns):
        finder.see(event)
    (drive_,) = finder.finish()
    assert (STALL in drive_.contacts) is known
    assert ("times as fast as that of the log" in drive_.stalls_about) is not known
