"""Messages come out in the order in which they arrived."""

from __future__ import annotations

import random

from cfnav_ros.bags.files.arrival_order import HOLD_NS, ArrivalOrder

MS = 1_000_000


def run(takes: list[tuple[int, int]]) -> tuple[list[int], list[int]]:
    """What comes out while (now, arrival) are taken, and at the end."""
    order: ArrivalOrder[int] = ArrivalOrder()
    out = [item for now, at in takes for _, item in order.take(at, at, now)]
    return out, [item for _, item in order.rest()]


def test_an_idle_process_gives_all_but_the_last_moments() -> None:
    out, rest = run([(t * MS, t * MS) for t in range(0, 2000, 10)])
    assert out == [t * MS for t in range(0, 1490, 10)]
    assert rest == [t * MS for t in range(1490, 2000, 10)]


def test_one_moment_keeps_the_order_in_which_it_was_taken() -> None:
    order: ArrivalOrder[str] = ArrivalOrder()
    for name in "abc":
        assert list(order.take(5, name, 5)) == []
    assert [item for _, item in order.rest()] == ["a", "b", "c"]


def test_a_backlog_after_a_stall_of_seconds_comes_out_in_order() -> None:
    """A clock every 10 ms and a scan every 130 ms; nothing is taken for 3 s, then by turns."""
    clock, scan = range(0, 6000, 10), range(3, 6000, 130)
    takes, waiting = [], [[*clock], [*scan]]
    now = 0.0
    while any(waiting):
        now += 0.5 if not 2000 < now < 5000 else 3000
        for topic in waiting:
            if topic and topic[0] <= now:
                takes.append((round(now * MS), topic.pop(0) * MS))
    assert [at for _, at in takes] != sorted(at for _, at in takes)
    out, rest = run(takes)
    assert out + rest == sorted(out + rest)
    assert len(out) > 0.8 * len(takes)


def test_any_disorder_shorter_than_what_is_held_is_mended() -> None:
    rng = random.Random(0)
    arrivals = sorted(rng.randrange(10_000 * MS) for _ in range(2000))
    takes = sorted((at + rng.randrange(HOLD_NS // 2), at) for at in arrivals)
    out, rest = run(takes)
    assert out + rest == arrivals
