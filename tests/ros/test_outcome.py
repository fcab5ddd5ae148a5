"""Outcomes against event lists written by hand."""

from __future__ import annotations

import dataclasses

import pytest
from cfnav_ros.outcome import Decision, Events, Status, Truth, split_episodes

from cfnav_core.actions import Action

S = 1_000_000_000


def truth(t: float, x: float = 0.0, y: float = 0.0, hits: int = 0, seen: bool = False) -> Truth:
    return Truth(
        int(t * S), x, y, 0.0, hits, seen, "kitchen:25", "Mug", 2.0, "Chair" if hits else ""
    )


def decision(t: float, step: int, action: Action = Action.MoveAhead) -> Decision:
    return Decision(int(t * S), int(t * S), step, action, 0.1, 0.2)


def start(t: float, goal: str = "Mug") -> Status:
    return Status(int(t * S), True, goal, "shipped")


def end(t: float, outcome: str = "done", goal: str = "Mug") -> Status:
    return Status(int(t * S), False, goal, "shipped", outcome, "said Done")


CLEAN = Events(
    statuses=[start(1), end(5)],
    decisions=[decision(2, 1), decision(3, 2), decision(4, 3, Action.Done)],
    truths=[truth(0.5, 9.0), truth(1.5), truth(2.5, 0.3), truth(3.5, 0.3, 0.4, seen=True)],
)


def test_clean_success_with_path_length_within_the_episode() -> None:
    (episode,) = split_episodes(CLEAN)
    row = dataclasses.asdict(episode.outcome)
    assert row.pop("path_length_m") == pytest.approx(0.7)  # the sample at 0.5 s is outside
    assert row == {
        "goal": "Mug",
        "room": "kitchen:25",
        "outcome": "done",
        "success": True,
        "collisions": 0,
        "cf_success": True,
        "steps": 3,
        "shortest_path_m": 2.0,
    }


def test_one_touch_keeps_success_and_ends_the_claim_of_none() -> None:
    truths = [truth(1.5), truth(2.5, 0.3, hits=1), truth(3.5, 0.3, 0.4, hits=3, seen=True)]
    (episode,) = split_episodes(dataclasses.replace(CLEAN, truths=truths))
    assert episode.outcome.success
    assert not episode.outcome.cf_success
    assert episode.outcome.collisions == 3
    assert [(c.x, c.y, c.count) for c in episode.contacts] == [(0.3, 0.0, 1), (0.3, 0.4, 2)]


def test_done_counts_only_with_the_goal_visible_at_that_decision() -> None:
    truths = [truth(1.5, seen=True), truth(4.0, seen=False), truth(4.9, seen=True)]
    (episode,) = split_episodes(dataclasses.replace(CLEAN, truths=truths))
    assert not episode.outcome.success


@pytest.mark.parametrize("outcome", ["step_limit", "time_limit", "aborted", "refused"])
def test_no_success_without_done_although_the_goal_is_visible(outcome: str) -> None:
    events = dataclasses.replace(CLEAN, statuses=[start(1), end(5, outcome)])
    (episode,) = split_episodes(events)
    assert (episode.outcome.success, episode.outcome.outcome) == (False, outcome)


def test_a_recording_cut_short_gives_an_unfinished_episode() -> None:
    (episode,) = split_episodes(dataclasses.replace(CLEAN, statuses=[start(1)]))
    assert (episode.outcome.outcome, episode.outcome.success) == ("unfinished", False)
    assert episode.outcome.steps == 3


def test_two_episodes_are_told_apart() -> None:
    second = [Truth(int(7.5 * S), 5.0, 5.0, 0.0, 0, True, "bedroom:23", "Book", 1.0)]
    events = Events(
        statuses=[*CLEAN.statuses, start(7, "Book"), end(9, "step_limit", "Book")],
        decisions=[*CLEAN.decisions, decision(8, 1)],
        truths=[*CLEAN.truths, *second],
    )
    first, last = split_episodes(events)
    assert (first.outcome.room, first.outcome.steps) == ("kitchen:25", 3)
    assert (last.outcome.room, last.outcome.steps, last.outcome.success) == ("bedroom:23", 1, False)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"statuses": [end(5)]}, "not its start"),
        ({"statuses": [start(1), end(5, goal="Book")]}, "not its start"),
        ({"truths": []}, "no ground truth"),
        ({"decisions": [decision(2, 1)]}, "no decision Done"),
    ],
)
def test_events_that_cannot_be_judged_are_refused(change: dict, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        split_episodes(dataclasses.replace(CLEAN, **change))
