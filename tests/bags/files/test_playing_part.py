"""A part of a bag is played, by options that make sense."""

from pathlib import Path

import pytest
from cfnav_ros.bags.files.playing import Cue, PlayOptions, cut
from cfnav_ros.bags.files.sources import Offer, PlayedTopic
from cfnav_ros.bags.files.storage import BagTopic

from cfnav_core.robot.topics import TOPICS
from studies.bags.bag_files import ZERO_NS, S


def source(role: str) -> PlayedTopic:
    usual = TOPICS[role]
    name, offer = f"/{usual.name}", Offer(usual.depth, usual.reliable, usual.latched)
    return PlayedTopic(role, BagTopic(name, "x"), name, offer)


def cue(role: str, second: float) -> Cue:
    at = round(second * S)
    return Cue(at, ZERO_NS + at, source(role), f"{role} {second}".encode())


def test_a_part_begins_with_what_latched_topics_had_said():
    said = [
        cue("tf_static", 0), cue("scan", 0), cue("tf_static", 1), cue("odom", 1),
        cue("odom", 2), Cue(2 * S, ZERO_NS), cue("scan", 3), cue("odom", 4), cue("scan", 6),
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
