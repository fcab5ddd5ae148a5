"""Actions inferred from odometry: hand-made paths, and drives of our own executor."""

import dataclasses
import math
from collections import Counter

import numpy as np
import pytest
from cfnav_ros.bags.files.events import Bumps, Joint, Pose
from cfnav_ros.bags.replay.driven import DrivenActions

from cfnav_core.task.actions import Action
from cfnav_core.task.camera import MAST
from tests.ros.scripted_robot import Robot, episode_of

DT, S = 0.05, 1_000_000_000
A, L, R = Action.MoveAhead, Action.RotateLeft, Action.RotateRight


class Path:
    """Odometry of a robot that is driven by hand."""

    def __init__(self, x=0.0, y=0.0, yaw=0.0):
        self.t, self.x, self.y, self.yaw, self.poses = 10.0, x, y, yaw, []
        self.go(0, 0, 0.1)

    def go(self, v, w, seconds):
        for _ in range(round(seconds / DT)):
            middle = self.yaw + w * DT / 2
            self.x += v * DT * math.cos(middle)
            self.y += v * DT * math.sin(middle)
            self.yaw += w * DT
            self.t += DT
            yaw = math.remainder(self.yaw, math.tau)
            self.poses.append(
                Pose(t_ns=round(self.t * S), x=self.x, y=self.y, yaw=yaw, v=v, w=w)
            )  # fmt: skip
        return self

    def rest(self, seconds=1.0):
        return self.go(0, 0, seconds)


def actions(path, driven=None):
    driven = driven or DrivenActions()
    return [action for pose in path.poses for action in driven.see(pose)]


def test_a_straight_line_is_a_move_every_quarter_of_a_metre():
    assert actions(Path(1.0, -2.0, 2.5).go(0.2, 0, 10.05)) == [A] * 8


def test_a_turn_in_place_is_a_rotation_every_45_degrees():
    assert actions(Path(yaw=3.0).go(0, 0.5, 2 * math.pi / 0.5)) == [L] * 8
    assert actions(Path(yaw=-3.0).go(0, -0.5, math.pi / 0.5)) == [R] * 4


def test_moves_and_turns_in_their_order():
    path = Path().go(0.2, 0, 1.25).rest().go(0, 1.0, math.pi / 4).rest().go(0.2, 0, 2.5)
    assert actions(path) == [A, L, A, A]


@pytest.mark.parametrize("radius", [0.2, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("side", [1, -1])
def test_a_circle_has_the_length_and_the_turns_of_a_circle(radius, side):
    length = 2 * math.pi * radius
    found = Counter(actions(Path().go(0.2, side * 0.2 / radius, length / 0.2)))
    assert found[L if side > 0 else R] == 8
    assert found[A] == pytest.approx(length / 0.25, abs=1)
    assert sum(found.values()) == found[A] + 8


def test_weaving_is_no_turn():
    path = Path()
    for _ in range(10):
        path.go(0.2, 0.5, 1.0).go(0.2, -0.5, 1.0)  # 29 degrees to either side
    assert set(actions(path)) == {A}


def test_backing_up_is_no_action_and_is_forgotten():
    driven = DrivenActions()
    assert actions(Path().go(-0.2, 0, 5.0), driven) == []
    assert driven.backed == 4
    # 0.1 m back and a rest: the next move ahead is a whole one again
    driven = DrivenActions()
    assert actions(Path().go(-0.1, 0, 1.0).rest().go(0.2, 0, 1.25), driven) == [A]
    assert driven.backed == 1
    # without a rest it counts against going ahead
    assert actions(Path().go(-0.1, 0, 1.0).go(0.2, 0, 1.25)) == []


def test_noise_of_a_standing_robot_is_no_action():
    rng = np.random.default_rng(0)
    driven, path = DrivenActions(), Path().rest(120.0)
    noisy = [
        dataclasses.replace(
            p, x=p.x + rng.normal(0, 0.003), y=p.y + rng.normal(0, 0.003),
            yaw=p.yaw + rng.normal(0, 0.01),
        )
        for p in path.poses
    ]  # fmt: skip
    assert [a for p in noisy for a in driven.see(p)] == []
    assert driven.at_keyframe


def test_noise_does_not_add_actions_to_a_drive():
    rng = np.random.default_rng(1)
    path = Path()
    for _ in range(5):
        path.go(0.2, 0, 1.25).rest().go(0, 0.5, math.pi / 2).rest()
    driven = DrivenActions()
    noisy = [
        dataclasses.replace(p, x=p.x + rng.normal(0, 0.001), yaw=p.yaw + rng.normal(0, 0.002))
        for p in path.poses
    ]  # fmt: skip
    assert [a for p in noisy for a in driven.see(p)] == [A, L] * 5


def test_creeping_gets_ahead_all_the_same():
    assert actions(Path().go(0.01, 0, 100.0)) == [A] * 4


def test_the_beginning_moves_along_until_the_robot_leaves():
    driven, path = DrivenActions(), Path().rest(3.0).go(0.2, 0, 1.0)
    near = []
    for pose in path.poses:
        assert driven.see(pose) == []
        near.append(driven.at_keyframe)
    standing = round(3.1 / DT)
    assert all(near[:standing])
    assert near[standing:].count(True) == pytest.approx(0.04 / 0.2 / DT, abs=1)
    assert not any(near[-10:])


def test_driving_against_something_is_a_move_ahead():
    driven, path = DrivenActions(), Path().go(0.2, 0, 0.6)
    assert actions(path, driven) == []
    pressed = Bumps(t_ns=path.poses[-1].t_ns, zones=("bump_front_center",))
    assert driven.see(pressed) == [A]
    assert driven.see(pressed) == []  # held, it is the same touch
    pushed = len(path.poses)
    path.go(0.03, 0, 1.0)
    assert [a for pose in path.poses[pushed:] for a in driven.see(pose)] == driven.stalled() == []
    assert driven.see(Bumps(t_ns=pressed.t_ns + 1, zones=())) == []
    # the reflex backs off by 0.1 m; then on
    met = len(path.poses)
    path.go(-0.1, 0, 1.0).rest().go(0.2, 0, 1.25)
    assert [a for pose in path.poses[met:] for a in driven.see(pose)] == [A]
    assert driven.backed == 1


def test_a_stall_ends_a_move_ahead():
    driven, path = DrivenActions(), Path().go(0.2, 0, 0.6)
    assert actions(path, driven) == []
    assert driven.stalled() == [A]
    assert driven.stalled() == []


def test_a_touch_of_a_standing_robot_is_nothing():
    driven, path = DrivenActions(), Path().rest()
    actions(path, driven)
    assert driven.touch() == []


def test_the_tilt_tells_looks():
    driven, path = DrivenActions(), Path()
    actions(path, driven)
    level, down = MAST.horizons
    angles = [level, level - 0.2, down + 0.02, down, down + 0.3, level]
    found = [driven.see(Joint(t_ns=k, angle=angle)) for k, angle in enumerate(angles)]
    assert found == [[], [], [Action.LookDown], [], [], [Action.LookUp]]


def test_the_beginning_waits_while_the_camera_tilts():
    driven, path = DrivenActions(), Path()
    actions(path, driven)
    begins = []
    for k, angle in enumerate((0.0, -0.1, -0.3, -0.45, -0.5, -0.52)):
        driven.see(Joint(t_ns=k, angle=angle))
        begins.append(driven.at_keyframe)
    assert begins == [True, False, False, False, True, True]


@pytest.mark.parametrize(("dx", "dyaw"), [(1.0, 0.0), (0.0, 2.0)])
def test_a_jump_of_the_odometry_is_no_motion(dx, dyaw):
    driven, path = DrivenActions(), Path().go(0.2, 0, 0.5)
    path.x += dx
    path.yaw += dyaw
    assert actions(path.go(0.2, 0, 1.25), driven) == [A]
    assert driven.left_out == 1


def test_what_was_driven_during_a_gap_is_not_guessed():
    driven, path = DrivenActions(), Path()
    path.t += 10.0
    path.x += 1.5
    assert actions(path.rest(), driven) == []
    assert driven.left_out == 1
    path.t += 10.0  # a gap during which it stood
    assert actions(path.go(0.2, 0, 1.25), driven) == [A]


def test_time_that_goes_back_begins_anew():
    driven = DrivenActions()
    assert actions(Path().go(0.2, 0, 1.0), driven) == []
    assert actions(Path(0.2).go(0.2, 0, 0.5), driven) == []
    assert driven.left_out == 1


def test_a_faster_base_does_not_jump():
    assert actions(Path().go(3.0, 0, 2.0)) == [A] * 24


def test_odometry_that_claims_any_speed_is_not_believed():
    driven = DrivenActions()
    poses = [Pose(t_ns=k * S // 20, x=k * 1e9, y=0.0, yaw=0.0, v=1e12, w=1e12) for k in range(10)]
    assert [a for pose in poses for a in driven.see(pose)] == []
    assert driven.left_out == 9


def test_our_own_drives_are_recognised():
    """What our executor drove, action by action, with looks and rests between."""
    rng = np.random.default_rng(2)
    wanted = [Action(int(k)) for k in rng.choice(3, 40, p=(0.5, 0.25, 0.25))]
    robot, driven, found = Robot(), DrivenActions(), []
    episode, _ = episode_of(*wanted, Action.Done)
    while not episode.ended:
        o = robot.odometry(robot.t)
        found += driven.see(Pose(t_ns=round(o.stamp * S), x=o.x, y=o.y, yaw=o.yaw, v=o.v, w=o.w))
        robot.tick(episode)
    assert found == wanted
    assert (driven.left_out, driven.backed) == (0, 0)
