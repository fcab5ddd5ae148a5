"""A policy that answers a list and a robot that does what it is told, in steps of node time."""

import dataclasses
import math
from concurrent.futures import Future
from types import SimpleNamespace

import numpy as np
from cfnav_ros.drive.episode import Episode
from cfnav_ros.drive.inputs import CameraFrame, SensorInputs, StampedEstimate, Tilt
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.drive.motion import Odometry
from cfnav_ros.drive.phases import Phase
from cfnav_ros.drive.preflight import BaseCheck
from cfnav_ros.lidar.estimate import Estimate, Verdict
from cfnav_ros.robot.stamps import NEVER

from cfnav_core.task.camera import MAST
from cfnav_core.task.p_hat import Known, make_p_hat

DT = 0.05
FREE = Estimate(0.01, 2.0, Verdict.GOOD, "", 1.0)
BLOCKED = Estimate(0.97, 0.10, Verdict.GOOD, "", 1.0)
BLIND = Estimate(1.0, 0.0, Verdict.BLIND, "Nothing returns.", 0.0)
OWN = 0.5
"""What the policy's own predictor always says."""
READY = BaseCheck(type="geometry_msgs/msg/TwistStamped")


class ScriptedPolicy:
    """Answers a fixed list of actions and keeps what it was shown."""

    goals = ("Laptop", "Mug")
    camera = MAST

    def __init__(self, *actions):
        self.actions = list(actions)
        self.given, self.calls = [], []

    def admits(self, goal):
        return "" if goal in self.goals else f"found goal {goal!r}, expected one of Laptop, Mug"

    def reset(self, goal):
        self.calls.append(("reset", goal))

    def act(self, rgb, collision_probability=None, p_hat=None, earlier=()):
        self.calls.append(("act", int(rgb[0, 0, 0])))
        known = Known(0.0, lambda: OWN, lidar=collision_probability, earlier=earlier)
        self.given.append(make_p_hat(p_hat, known))
        return SimpleNamespace(
            action=self.actions.pop(0),
            probabilities=np.full(6, 1 / 6, np.float32),
            collision_probability=collision_probability or 0.0,
            detection_score=0.5,
        )


def run_now(function, *args):
    future = Future()
    try:
        future.set_result(function(*args))
    except Exception as error:
        future.set_exception(error)
    return future


class Robot:
    """Moves as commanded after one period; reports everything every period."""

    def __init__(self):
        self.t = 100.0
        self.x = self.y = self.yaw = self.tilt = self.v = self.w = 0.0
        self.estimate, self.base = FREE, READY
        self.bumper = False
        self.bumped = self.bump_stamp = NEVER  # when the newest report of it came, and its stamp
        self.stuck, self.tilt_stuck, self.slips = False, False, False
        self.odometry = lambda t: Odometry(t, self.x, self.y, self.yaw, self.v, self.w)
        self.fields = {}  # inputs that are other than they should be
        self.frozen = set()  # inputs that no longer arrive
        self.lead = 0.0  # by which the stamps of camera and LiDAR are ahead
        self.inputs = None
        self.commands, self.tilts, self.records = [], [], []

    def sense(self):
        ns = round(self.t * 1e9)
        picture = np.full((4, 4, 3), int(self.t * 20) % 256, np.uint8)
        new = SensorInputs(
            base=self.base,
            frame=CameraFrame(ns, lambda: picture),
            estimate=StampedEstimate(ns, self.estimate),
            odometry=self.odometry(self.t),
            tilt=Tilt(self.t, self.tilt),
            bumper=self.bumper,
            bumped_at=self.bump_stamp,
            arrived={"bumped_at": self.bumped},
        )
        new = dataclasses.replace(new, **self.fields)
        if self.lead:
            new = self._stamped_ahead(new)
        if self.inputs:
            kept = {name: getattr(self.inputs, name) for name in self.frozen}
            new = dataclasses.replace(new, **kept)
        self.inputs = new
        return new

    def _stamped_ahead(self, new):
        ns, came = round((self.t + self.lead) * 1e9), {"frame": self.t, "estimate": self.t}
        return dataclasses.replace(
            new,
            frame=dataclasses.replace(new.frame, stamp_ns=ns),
            estimate=dataclasses.replace(new.estimate, stamp_ns=ns),
            arrived={**new.arrived, **came},
        )

    def tick(self, episode):
        output = episode.update(self.t, self.sense())
        self.commands.append((self.t, output.command))
        if output.tilt is not None:
            self.tilts.append(output.tilt)
            if not self.tilt_stuck:
                step = max(-0.1, min(0.1, output.tilt - self.tilt))
                self.tilt += step
        if output.record:
            self.records.append((self.t, output.record))
        self.move(output.command)
        self.t += DT
        return output

    def move(self, command):
        """What the base does with a command until the next."""
        self.v, self.w = (0.0, 0.0) if self.stuck else (command.v, command.w)
        grip = 0.0 if self.slips else 1.0
        self.x += grip * self.v * math.cos(self.yaw) * DT
        self.y += grip * self.v * math.sin(self.yaw) * DT
        self.yaw += grip * self.w * DT

    def run(self, episode, until=lambda episode: episode.ended, limit=120.0):
        end = self.t + limit
        while not until(episode):
            self.tick(episode)
            assert self.t < end, f"nothing came of it, phase {episode.phase}"
        return episode


def episode_of(*actions, goal="Laptop", submit=run_now, time_limit=0.0, **limits):
    policy = ScriptedPolicy(*actions)
    episode = Episode(goal, policy, submit, EpisodeLimits(**limits), time_limit=time_limit)
    return episode, policy


def driving(episode):
    return episode.phase is Phase.MOVE and episode.track.path_length > 0.05
