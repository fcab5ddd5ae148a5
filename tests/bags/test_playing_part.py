"""A part of a bag is played, by options that make sense."""

from pathlib import Path

import pytest
from cfnav_ros.bags.playing import Beat, PlayOptions, cut
from cfnav_ros.bags.sources import USUAL, Source
from cfnav_ros.bags.storage import Topic

from tests.bags.bag_files import ZERO_NS, S


def source(role: str) -> Source:
    name, offer = USUAL[role]
    return Source(role, Topic(f"/{name}", "x"), f"/{name}", offer)


def beat(role: str, second: float) -> Beat:
    at = round(second * S)
    return Beat(at, ZERO_NS + at, source(role), f"{role} {second}".encode())


def test_a_part_begins_with_what_latched_topics_had_said():
    said = [
        beat("tf_static", 0), beat("scan", 0), beat("tf_static", 1), beat("odom", 1),
        beat("odom", 2), Beat(2 * S, ZERO_NS), beat("scan", 3), beat("odom", 4), beat("scan", 6),
    ]  # fmt: skip
    part = list(cut(said, 3 * S, 2 * S))
    told = [(b.data.decode(), b.at_ns) for b in part]
    assert told == [("tf_static 0", 0), ("tf_static 1", 0), ("odom 2", 0), ("scan 3", 0),
                    ("odom 4", S)]  # fmt: skip
    assert all(b.clock_ns >= ZERO_NS + 3 * S for b in part)
    assert list(cut(said, 0, float("inf"))) == said
    assert list(cut(said, 60 * S, S)) == []


@pytest.mark.parametrize(
    "wrong",
    [
        {"rate": -1.0}, {"rate": float("nan")}, {"rate": float("inf")}, {"start": -0.1},
        {"wait": float("inf")}, {"duration": 0.0}, {"duration": float("nan")},
    ],
)  # fmt: skip
def test_options_that_make_no_sense_are_one_sentence(wrong):
    (name,) = wrong
    with pytest.raises(ValueError, match=f"^--{name} is .*, expected .*\\.$"):
        PlayOptions(Path("bag"), **wrong).check()
    PlayOptions(Path("bag"), rate=0.0, start=3.0, duration=1.0).check()
