"""What a bag says of its drives, from its messages to the figures."""

from dataclasses import replace

import pytest
from cfnav_ros.bags.evaluation import JudgeOptions, evaluate
from cfnav_ros.bags.judge.contacts import BUMP, OBSERVABLE, TRUTH
from cfnav_ros.bags.judge.episodes_file import EpisodeRow
from cfnav_ros.bags.summary import summarise

from studies.bags.bag_files import ZERO_NS, Message, S, drive, hazards, write

DONE_S, NO_DONE_S = 2.5, 1.5
"""Seconds of ``drive``: its last decision is Done, or it is another."""


def changed(messages, topic, **fields):
    """The messages with other fields on one topic."""
    return [
        m._replace(message=replace(m.message, **fields)) if m.topic == topic else m
        for m in messages
    ]


def outcome_of(path, messages, rows=()):
    (found,) = evaluate(write(path / "bag", messages), JudgeOptions(rows=rows)).drives
    return found.outcome


def cut(seconds, seen=True):
    """An episode whose end was not recorded."""
    return changed(drive(seconds), "/ground_truth/state", goal_visible=seen)[:-1]


@pytest.mark.parametrize("seen", [True, False])
def test_done_counts_although_the_end_was_not_recorded(tmp_path, seen):
    outcome = outcome_of(tmp_path, cut(DONE_S, seen))
    assert outcome.outcome == "unfinished"
    assert (outcome.success.value, outcome.success.source) == (seen, TRUTH)
    assert outcome.success_by == {TRUTH: seen, OBSERVABLE: True}


def test_a_drive_whose_end_is_not_in_the_bag_is_neither_a_success_nor_a_failure(tmp_path):
    bag = evaluate(write(tmp_path / "bag", cut(NO_DONE_S)), JudgeOptions())
    (found,) = bag.drives
    assert found.outcome.success.value is None
    assert found.outcome.success.why == "the bag does not hold its end"
    assert found.outcome.success_by == {}
    figures = summarise([bag]).figures
    for name in ("sr", "cf_sr"):
        assert figures[name].drives == 0
        assert figures[name].left_out == {"the bag does not hold its end": 1}
    assert figures["collisions"].drives == 1


@pytest.mark.parametrize(("seconds", "count"), [(0.5, 0), (2.0, 1)])
def test_a_bumper_that_reports_only_when_pressed_counts_from_its_first_report(
    tmp_path, seconds, count
):
    at = ZERO_NS + round(seconds * S)
    kind = "irobot_create_msgs/msg/HazardDetectionVector"
    bump = Message("/hazard_detection", kind, at, hazards(at, "bump_front_left"))
    others = [m for m in drive(3.0) if m.type != kind]
    messages = sorted([*others, bump], key=lambda m: m.log_ns)
    assert outcome_of(tmp_path, messages).collisions_by[BUMP] == count


@pytest.mark.parametrize("ending", ["done", "step_limit"])
@pytest.mark.parametrize("goal", ["Laptop", "Fridge"])
def test_only_what_the_policy_says_of_a_row_s_goal_tells_whether_it_was_reached(
    tmp_path, goal, ending
):
    messages = [m for m in drive(DONE_S) if m.topic != "/ground_truth/state"]
    messages = changed(messages, "/policy/episode", outcome=ending)
    outcome = outcome_of(tmp_path, messages, [EpisodeRow("bag", 0.0, 2.45, goal)])
    if goal == "Laptop":
        assert outcome.success_by == {OBSERVABLE: ending == "done"}
    else:
        assert outcome.success_by == {}
        assert "neither the policy nor a file" in outcome.success.why
    assert outcome.bundle == "demo"
