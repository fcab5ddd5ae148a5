"""Slip and motion without a command, from odometry alone."""

import math

import pytest
from cfnav_ros.drive.disturbance import Slip, Standing
from cfnav_ros.drive.motion import Odometry
from cfnav_ros.drive.track import Track

DT = 0.05


def drive(slip, v=0.0, w=0.0, share=1.0, samples=20, start=0.0):
    """Feed odometry whose pose goes ``share`` of what its twist says."""
    sentences = []
    for k in range(samples):
        t = k * DT
        slip.take(Odometry(start + t, share * v * t, 0.0, share * w * t, v, w))
        sentences.append(slip.complaint())
    return sentences


@pytest.mark.parametrize(("v", "w"), [(0.2, 0.0), (-0.2, 0.0), (0.1, 0.0), (0.0, 1.0), (0.0, -0.3)])
def test_a_pose_that_stands_while_the_twist_moves_is_told_within_the_window(v, w):
    sentences = drive(Slip(), v, w, share=0.0)
    first = next(k for k, sentence in enumerate(sentences) if sentence)
    assert first * DT <= 0.35
    assert "while the pose stands" in sentences[-1]
    assert f"{v:.2f} m/s and {w:.2f} rad/s" in sentences[-1]


@pytest.mark.parametrize(
    ("v", "w", "share"),
    [(0.2, 0.0, 1.0), (0.2, 0.0, 0.5), (0.0, 1.0, 0.5), (0.05, 0.1, 0.0), (0.0, 0.0, 1.0)],
)
def test_driving_standing_creeping_and_a_little_slip_are_fine(v, w, share):
    assert not any(drive(Slip(), v, w, share))


def test_stamps_that_repeat_or_go_back_do_no_harm():
    slip = Slip()
    for _ in range(50):
        slip.take(Odometry(1.0, 0.0, 0.0, 0.0, 0.2, 0.0))
    assert slip.complaint() == ""
    drive(slip, 0.2, share=0.0, start=10.0)
    assert slip.complaint()
    slip.take(Odometry(5.0, 0.0, 0.0, 0.0, 0.2, 0.0))
    assert slip.complaint() == ""


@pytest.mark.parametrize("pose", [(0.04, 0.0, 0.0), (0.0, -0.04, 0.0), (0.0, 0.0, 0.06)])
def test_a_base_that_leaves_its_rest_is_told_once(pose):
    standing = Standing()
    assert not standing.moved(Odometry(0.0, 0.0, 0.0, 0.0), resting=True)
    assert not standing.moved(Odometry(0.1, 0.01, 0.0, 0.01), resting=True)
    assert standing.moved(Odometry(0.2, *pose), resting=False)
    assert not standing.moved(Odometry(0.3, *pose), resting=False)
    assert not standing.moved(Odometry(0.4, *pose), resting=True)
    assert standing.moved(Odometry(0.5, 0.0, 0.0, 0.0), resting=False)


def test_a_base_that_coasts_or_is_told_to_move_is_not_pushed():
    standing = Standing()
    for k in range(10):
        assert not standing.moved(Odometry(k * DT, 0.01 * k, 0.0, 0.0), resting=False)
    assert not standing.moved(Odometry(1.0, 0.1, 0.0, 0.0), resting=True)
    standing.release()
    assert not standing.moved(Odometry(2.0, 0.4, 0.0, 0.0), resting=True)


def test_a_pose_that_drifts_is_not_standing_whatever_the_twist_says():
    track = Track()
    for k in range(10):
        track.odometry(Odometry(k * DT, 0.3 * k * DT, 0.0, 0.0))
    assert track.still_since is None
    for k in range(10, 14):
        track.odometry(Odometry(k * DT, 0.135, 0.0, 0.0))
    assert track.still_since == pytest.approx(10 * DT)
    track = Track()
    for k in range(10):
        track.odometry(Odometry(k * DT, 0.0, 0.0, math.radians(1.0) * k))
    assert track.still_since is None
