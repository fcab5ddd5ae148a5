"""Drives without recorded decisions: what was driven is inferred of the motions."""

import numpy as np
from cfnav_ros.bags.files.events import Bumps, Decided, LaserTurn, Picture, Pose, Told
from cfnav_ros.bags.replay.estimates import Estimates
from cfnav_ros.bags.replay.replay import Replay
from cfnav_ros.bags.replay.step import labelled, reproduction

from cfnav_core.policy.policy import Policy
from cfnav_core.task.actions import Action
from tests.bags.live_drives import RecordedRobot, blocks, without
from tests.bags.replay.replays import WITHOUT_LIDAR, S, decisions, replay


def teleoperated(events):
    return without(events, lambda e: isinstance(e, Decided))


def test_inferred_decisions_are_those_that_were_driven(bundle, policy):
    robot, live = RecordedRobot(seed=4), Policy.load(bundle)
    for goal in ("Mug", "Laptop"):
        robot.drive(live, goal, max_steps=15, veto=False)
    events = robot.events
    run = replay(teleoperated(events), policy, infer=True)
    motions = (Action.MoveAhead, Action.RotateLeft, Action.RotateRight)
    for drive_ns in {s.drive_ns for s in run.steps}:
        end = next(e.t_ns for e in events if isinstance(e, Told) and e.t_ns > drive_ns)
        executed = [
            d.action
            for d in decisions(events)
            if drive_ns <= d.t_ns <= end and not d.vetoed and d.action in motions
        ]
        found = [s.driven for s in run.steps if s.drive_ns == drive_ns and s.driven in motions]
        assert found == executed
        assert len(set(found)) > 1
    assert run.left_out == []
    assert reproduction(run.steps).decisions == 0
    assert all(s.t_ns < s.until_ns for s in run.steps)
    assert all(s.image_ns <= s.t_ns and s.t_ns - s.image_ns < S for s in run.steps)


def test_inferred_decisions_keep_the_live_rule_of_ages(recorded, policy):
    events = teleoperated(recorded[0])
    first = next(e.t_ns for e in events if isinstance(e, Picture))
    blind = replay(
        without(events, lambda e: isinstance(e, Picture) and e.t_ns > first), policy, infer=True
    )
    assert any(o.reason.startswith("The newest picture is") for o in blind.left_out)
    assert all(s.t_ns - s.image_ns <= S for s in blind.steps)
    none = replay(without(events, lambda e: isinstance(e, Picture)), policy, infer=True)
    assert none.steps == []
    assert {o.reason for o in none.left_out} == {"No picture has arrived."}


def test_inferred_decisions_without_a_lidar_take_the_bundles_own_predictor(recorded, policy):
    events = without(teleoperated(recorded[0]), lambda e: isinstance(e, LaserTurn))
    run = replay(events, policy, infer=True, limits=WITHOUT_LIDAR)
    assert run.steps
    assert {s.estimate_ns for s in run.steps} == {0}
    # with one that is silent it is blind, as a live node would be
    silent = replay(events, policy, infer=True)
    assert {s.p_hat for s in silent.steps} == {1.0}


def test_a_drive_without_a_goal_is_not_replayed(recorded, policy):
    events = without(teleoperated(recorded[0]), lambda e: isinstance(e, Told))
    assert replay(events, policy, infer=True).steps == []
    estimates = Estimates()
    run = Replay({"restless": policy}, estimates, infer=True)
    run.begin("Laptop", events[0].t_ns)
    for event in events:
        estimates.see(event)
        run.see(event)
    run.finish()
    assert run.steps
    assert {s.goal for s in run.steps} == {"Laptop"}


def test_a_bump_ends_an_inferred_move_and_labels_it(policy):
    events, pressed_ns = [], 0
    rng = np.random.default_rng(0)
    for k in range(60):
        t, x = k * S // 20, min(max(k - 20, 0), 15) * 0.01
        rgb = blocks(rng)
        events.append(Picture(t_ns=t, log_ns=t, data=rgb, decode=lambda rgb=rgb: rgb))
        events.append(Pose(t_ns=t, log_ns=t, x=x, y=0.0, yaw=0.0, v=0.2, w=0.0))
        if k == 36:
            pressed_ns = t
            events.append(Bumps(t_ns=t, log_ns=t, zones=("bump_front_center",)))
    run = Replay({"restless": policy}, Estimates(), WITHOUT_LIDAR, infer=True)
    run.begin("Mug", 0)
    for event in events:
        run.see(event)
    run.finish()
    (only,) = labelled(run.steps, [pressed_ns])
    assert (only.driven, only.collided) == (Action.MoveAhead, True)
    assert S <= only.t_ns < pressed_ns == only.until_ns
