"""Events of bags, made by hand: times in seconds, from a bag that begins at 100 s."""

import dataclasses
import math

import numpy as np
from cfnav_ros.bags.files.events import Bumps, Decided, Judged, Pose, Told, Truth, Velocity
from cfnav_ros.lidar.estimate import Estimate, Verdict

from cfnav_core.task.actions import Action

S = 1_000_000_000


def ns(t):
    return round(t * S)


def at(t, log=None, topic=""):
    return {"t_ns": ns(t), "log_ns": ns(t if log is None else log), "topic": topic}


def pose(t, x=0.0, y=0.0, yaw=0.0, v=0.0, w=0.0, **rest):
    return Pose(**at(t, topic="odom", **rest), x=x, y=y, yaw=yaw, v=v, w=w)


def told(t, started, goal="Mug", outcome="", **rest):
    return Told(
        **at(t, topic="policy/episode", **rest),
        started=started, goal=goal, bundle="shipped", outcome=outcome, message="",
    )  # fmt: skip


def start(t, goal="Mug", **rest):
    return told(t, True, goal, **rest)


def end(t, goal="Mug", outcome="done", **rest):
    return told(t, False, goal, outcome, **rest)


def decided(t, step=1, action=Action.MoveAhead, score=0.2, vetoed=False, goal="Mug"):
    return Decided(
        **at(t, topic="policy/decision"),
        goal=goal, image_ns=ns(t), estimate_ns=ns(t), step=step, action=action,
        probabilities=np.full(6, 1 / 6, np.float32), collision_probability=0.1,
        detection_score=score, vetoed=vetoed,
    )  # fmt: skip


def truth(t, x=0.0, y=0.0, hits=0, seen=False, goal="Mug", speed=0.0, log=None):
    return Truth(
        **at(t, log, "ground_truth/state"),
        x=x, y=y, yaw=0.0, v=0.0, collisions=hits, contact_with="Chair" if hits else "",
        impact_speed=speed, goal=goal, goal_visible=seen, room="kitchen:25", shortest_path=2.0,
    )  # fmt: skip


def velocity(t, v=0.0, w=0.0):
    return Velocity(**at(t, topic="cmd_vel"), v=v, w=w)


def bumps(t, *zones):
    return Bumps(**at(t, topic="hazard_detection"), zones=zones)


def judged(t, clearance=1.0, verdict=Verdict.GOOD, probability=0.1, reason=""):
    estimate = Estimate(probability, clearance, verdict, reason, 1.0)
    return Judged(**at(t, topic="collision/estimate"), estimate=estimate)


def drive(begin, *parts, x=0.0, yaw=0.0, hz=20.0):
    """Commands and odometry of parts (seconds, told v, told w, true v, true w, reported v)."""
    events, t, y = [], begin, 0.0
    for seconds, v, w, true_v, true_w, *reported in parts:
        for _ in range(round(seconds * hz)):
            events.append(velocity(t, v, w))
            events.append(pose(t, x, y, yaw, reported[0] if reported else true_v, true_w))
            x += true_v * math.cos(yaw) / hz
            y += true_v * math.sin(yaw) / hz
            yaw += true_w / hz
            t += 1 / hz
    return events


def recorded(*parts, odometry=20.0, commands=20.0, sigma=0.0, heading=0.0, seed=0):
    """A drive of parts at these rates (Hz, 100 at most), with noise of place (m), heading (rad)."""
    rng, events = np.random.default_rng(seed), []
    for number, event in enumerate(drive(100, *parts, hz=100.0)):
        is_pose = isinstance(event, Pose)
        if (number // 2) % round(100.0 / (odometry if is_pose else commands)):
            continue
        if is_pose:
            x, y, yaw = rng.normal((event.x, event.y, event.yaw), (sigma, sigma, heading))
            event = dataclasses.replace(event, x=x, y=y, yaw=yaw)
        events.append(event)
    return events
