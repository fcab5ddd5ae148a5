"""Bags that are not as usual, from the file to the figures."""

import dataclasses

import numpy as np
import pytest
from cfnav_ros.bags.evaluation import JudgeOptions, evaluate
from cfnav_ros.bags.files.events import Bumps, Decided, Picture, Pose, Tick, Told
from cfnav_ros.bags.judge.contacts import CLEARANCE, STALL
from cfnav_ros.bags.judge.episodes_file import EpisodeRow
from cfnav_ros.bags.replay.step import reproduction
from cfnav_ros.bags.summary import summarise
from cfnav_ros.drive.limits import EpisodeLimits

from cfnav_core.policy.policy import Policy
from cfnav_core.task.actions import Action
from studies.bags import bag_files as b
from tests.bags.event_bag import bag_of, messages_of
from tests.bags.live_drives import RecordedRobot, blocks, restless_bundle, without
from tests.bags.made import drive as drive_of
from tests.bags.made import end, start, truth
from tests.bags.made import pose as pose_at

S = 1_000_000_000
SYSTEM_NS = 1_700_000_000 * S


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    return restless_bundle(tmp_path_factory.mktemp("bundle"))


@pytest.fixture(scope="module")
def recorded(bundle):
    """Two drives with the LiDAR; the first MoveAhead bumps against something."""
    robot, live = RecordedRobot(seed=1), Policy.load(bundle)
    for goal in ("Mug", "Laptop"):
        robot.drive(live, goal, max_steps=15)
    return with_bump(robot.events)


def with_bump(events):
    """The events with a bump 0.6 s after the first MoveAhead that was executed."""
    decisions = [e for e in events if isinstance(e, Decided) and not e.vetoed]
    move = next(d for d in decisions if d.action is Action.MoveAhead)
    times = [(events[0].t_ns, ()), (move.t_ns + 6 * S // 10, ("bump_front_center",))]
    made = [Bumps(t_ns=t_ns, log_ns=t_ns, zones=zones) for t_ns, zones in times]
    return sorted([*events, *made], key=lambda e: e.log_ns)


def logged_later(events, ns):
    """The events and /clock, recorded in a time that is so much ahead of their stamps."""
    made = []
    for e in events:
        log_ns = e.log_ns + ns
        made += [Tick(t_ns=e.log_ns, log_ns=log_ns), dataclasses.replace(e, log_ns=log_ns)]
    return made


def judged(path, events, bundle, **options):
    return evaluate(
        bag_of(path, events), JudgeOptions(bundles={"restless": str(bundle)}, **options)
    )


def held(found):
    """Seconds by verdict of the estimates that were made again."""
    (topic,) = (t for t in found.topics if t.kind == "Judged")
    return topic.verdicts


@pytest.mark.parametrize("infer", [False, True])
@pytest.mark.parametrize("ahead_ns", [SYSTEM_NS, -50 * S])
def test_log_times_of_another_clock_lose_nothing(recorded, bundle, tmp_path, infer, ahead_ns):
    """Simulated stamps under system log times, and stamps that are ahead of them."""
    events = without(recorded, lambda e: infer and isinstance(e, Decided))
    usual = judged(tmp_path / "usual", events, bundle)
    found = judged(tmp_path / "other", logged_later(events, ahead_ns), bundle)
    assert len(usual.drives) == len(found.drives) == 2
    assert found.left_out == usual.left_out
    for before, now in zip(usual.drives, found.drives, strict=True):
        made = [(s.step, s.driven, s.p_hat, s.collided) for s in now.steps]
        assert made == [(s.step, s.driven, s.p_hat, s.collided) for s in before.steps]
        assert all(
            now.drive.start_ns <= s.t_ns <= s.until_ns <= now.drive.end_ns for s in now.steps
        )
        assert now.outcome.clearance_m.value == before.outcome.clearance_m.value is not None
        assert now.drive.contacts.keys() == before.drive.contacts.keys() >= {CLEARANCE}
        assert now.pictures == before.pictures
        assert len(now.pictures) > 3
        if not infer:
            result = reproduction(now.steps)
            assert result.equal == result.decisions == len(now.drive.decisions) > 5
    assert [[s.collided for s in d.steps].count(True) for d in found.drives] == [1, 0]
    assert held(found) == pytest.approx(held(usual), abs=0.3)
    assert held(found)["GOOD"] > 0.8 * found.seconds


def test_a_base_whose_clock_is_ahead_does_not_blind_the_lidar(recorded, bundle, tmp_path):
    """Without /clock the computer's own time is that of the nodes."""
    events = [
        dataclasses.replace(e, t_ns=e.t_ns + S) if isinstance(e, Pose) else e for e in recorded
    ]
    found = judged(tmp_path / "bag", events, bundle)
    assert held(found).get("BLIND", 0.0) < 0.5
    assert found.left_out == ()
    assert all(reproduction(d.steps).equal == len(d.drive.decisions) for d in found.drives)


def test_an_empty_scan_topic_leaves_the_recorded_estimates(tmp_path):
    messages = [m for m in b.drive(3.0) if m.topic != "/scan"]
    silent = [("/scan", "sensor_msgs/msg/LaserScan")]
    ((only,), (other,)) = (
        evaluate(b.write(tmp_path / f"bag{k}", messages, silent=topics), JudgeOptions()).drives
        for k, topics in enumerate(([], silent))
    )
    assert only.outcome.clearance_m.value == other.outcome.clearance_m.value == 0.5


def test_every_decision_of_a_goal_that_a_bundle_does_not_know_counts(recorded, bundle, tmp_path):
    events = [
        dataclasses.replace(e, goal="Unicorn")
        if isinstance(e, Told | Decided) and e.goal == "Mug"
        else e
        for e in recorded
    ]
    found = judged(tmp_path / "bag", events, bundle)
    unanswered = len(found.drives[0].drive.decisions)
    (scores,) = summarise([found]).bundles
    assert scores.left_out == len(found.left_out) == unanswered > 5
    assert scores.agreement.steps == len(found.drives[1].drive.decisions)


def test_truth_of_another_episode_tells_no_length(tmp_path):
    events = [start(101), end(105)]
    events += [pose_at(100 + k / 20, k / 100) for k in range(120)]
    events += [truth(100 + k / 10, k / 50, goal="Fridge") for k in range(60)]
    path = bag_of(tmp_path / "bag", sorted(events, key=lambda e: e.log_ns))
    (only,) = evaluate(path, JudgeOptions()).drives
    assert only.outcome.path_length_m.value == pytest.approx(0.8, abs=0.02)
    assert not only.outcome.truth_length_m.known
    assert "truth" not in only.outcome.collisions_by


def test_a_stall_ends_an_inferred_move_and_labels_it(bundle, tmp_path):
    """Teleoperated against a wall without a bumper, held there, then backed off."""
    parts = [(1, 0, 0, 0, 0), (0.8, 0.2, 0, 0.2, 0), (2, 0.2, 0, 0, 0), (1.5, -0.2, 0, -0.2, 0)]
    driven, rng = drive_of(100, *parts), np.random.default_rng(0)
    for k in range(20 * 5):
        rgb, at_ns = blocks(rng), 100 * S + k * S // 20
        driven.append(Picture(t_ns=at_ns, log_ns=at_ns, data=rgb, decode=lambda rgb=rgb: rgb))
    rows = (EpisodeRow("", 0.0, 5.0, "Mug"),)
    found = judged(
        tmp_path / "bag", sorted(driven, key=lambda e: e.log_ns), bundle,
        rows=rows, limits=EpisodeLimits(p_hat="own", veto=False),
    )  # fmt: skip
    (only,) = found.drives
    (contact,) = only.contacts
    assert contact.source == STALL
    (step,) = only.steps
    assert (step.driven, step.collided) == (Action.MoveAhead, True)
    assert step.t_ns < contact.t_ns < step.until_ns


def test_a_bag_of_two_robots_is_judged_for_the_one_that_is_asked_for(tmp_path):
    ways = {"/r1": 0.0, "/r2": 0.2}  # m/s
    said = [
        message
        for name, v in ways.items()
        for message in messages_of(drive_of(100, (4.0, v, 0.0, v, 0.0)), name)
    ]
    said += [
        b.Message(f"{name}/scan", "sensor_msgs/msg/LaserScan", t, b.scan(t, 1.0 + v))
        for name, v in ways.items()
        for t in range(100 * S, 104 * S, S // 8)
    ]
    bag = b.write(tmp_path / "bag", sorted(said, key=lambda m: m.log_ns))
    first, second = (evaluate(bag, JudgeOptions(namespace=name)) for name in ("", "r2"))
    assert first.drives[0].outcome.driven_m.value == pytest.approx(0.0)
    assert second.drives[0].outcome.driven_m.value == pytest.approx(0.79, abs=0.011)
    assert {name.split("/")[1] for name in second.roles.values()} == {"r2"}
    sentence = "The bag holds several robots, /r1, /r2: /r1 was chosen, --namespace /r2 judges"
    assert [note.startswith(sentence) for note in first.notes] == [True]
    assert second.notes == ()
