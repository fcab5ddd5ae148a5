"""Drives of a real policy through real episodes on the scripted robot, recorded as events."""

import dataclasses

import numpy as np
from cfnav_ros.bags.files.events import Decided, Joint, LaserTurn, Picture, Pose, Told
from cfnav_ros.bags.replay.estimates import as_published
from cfnav_ros.drive.episode import Episode
from cfnav_ros.drive.inputs import CameraFrame, StampedEstimate
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.lidar.mounting import Mounting
from cfnav_ros.lidar.scan_watch import LidarParameters, ScanWatch

from cfnav_core.files.checkpoint import load_tensors, save_tensors
from cfnav_core.learn.export import export_bundle
from tests.core.model_samples import older_perception, save_fresh
from tests.ros.lidar_scans import behind_posts, noisy, scan_of, wall_ahead
from tests.ros.scripted_robot import Robot, run_now

WALLS = [behind_posts(scan_of(wall_ahead(x))) for x in (0.38, 0.42, 0.45, 0.6, 1.5)]
PARAMETERS = LidarParameters()


def restless_bundle(folder):
    """A bundle that has learnt nothing, but whose answers vary with all that it sees and did."""
    perception = older_perception()  # it tells pictures of a few colours from one another
    checkpoint = save_fresh(folder / "fresh.safetensors", "compact", perception, ("Mug", "Laptop"))
    tensors, head = load_tensors(checkpoint)
    for name in ("model.lstm.weight_ih", "model.lstm.weight_hh"):
        tensors[name] *= 10
    for action, bias in enumerate((3, 2, 2, 0, 0, -30)):  # it moves, and never says Done
        tensors["model.actor.bias"][action] = bias
    save_tensors(checkpoint, tensors, head)
    export_bundle(checkpoint, perception, folder / "bundle", "restless")
    return folder / "bundle"


def blocks(rng):
    """A picture, uint8 [150, 150, 3], of nine colours: to perception one is unlike another."""
    return rng.integers(0, 255, (3, 3, 3), np.uint8).repeat(50, 0).repeat(50, 1)


class RecordedRobot(Robot):
    """Sees noise and walls; everything that it and the policy say becomes an event.

    Attributes:
        silent: the scanner says nothing.
    """

    def __init__(self, seed):
        super().__init__()
        self.rng, self.events = np.random.default_rng(seed), []
        p = PARAMETERS
        mounting = Mounting(p.mount, p.disc.mount, False, p.base_frame, p.frame)
        self.watch = ScanWatch(p.stale, p.frozen, mounting, p.disc, p.errors)
        self.silent, self.ticks, self.live = False, 0, StampedEstimate()

    def record(self, kind, t_ns, **values):
        self.events.append(kind(t_ns=t_ns, log_ns=round(self.t * 1e9), **values))

    def sense(self):
        now_ns = round(self.t * 1e9)
        picture = blocks(self.rng)
        self.record(Picture, now_ns, data=picture, decode=lambda: picture)
        self.scan(now_ns)
        o = self.odometry(self.t)
        self.record(Pose, now_ns, x=o.x, y=o.y, yaw=o.yaw, v=o.v, w=o.w)
        self.record(Joint, now_ns, angle=self.tilt)
        frame = CameraFrame(now_ns, lambda: picture, 150, 150, picture)
        self.fields = {"frame": frame, "estimate": self.live}
        return super().sense()

    def scan(self, now_ns):
        self.ticks += 1
        stamp_ns = now_ns - 3_000_000
        if self.silent:
            blind = self.watch.silence(now_ns * 1e-9) if self.ticks % 2 else None
            if blind is not None:
                self.live = StampedEstimate(now_ns, as_published(blind))
            return
        if self.ticks % 3 != 1:
            return
        scan = noisy(WALLS[self.rng.integers(len(WALLS))], self.rng)
        self.record(LaserTurn, stamp_ns, scan=scan)
        estimate, timely = self.watch.scan(now_ns * 1e-9, stamp_ns * 1e-9, scan)
        assert timely
        self.live = StampedEstimate(stamp_ns, as_published(estimate))

    def drive(self, policy, goal, seconds=120.0, **limits):
        """One episode, from start to end."""
        episode = Episode(goal, policy, run_now, EpisodeLimits(**limits))
        self.tell(episode, policy, True)
        end = self.t + seconds
        while not episode.ended:
            assert self.t < end, f"nothing came of it, phase {episode.phase}"
            output = self.tick(episode)
            if output.record:
                self.decided(goal, output.record)
        self.tell(episode, policy, False)
        return episode

    def tell(self, episode, policy, started):
        self.record(
            Told, round(self.t * 1e9), started=started, goal=episode.goal, bundle=policy.name,
            outcome=episode.outcome, message=episode.message,
        )  # fmt: skip

    def decided(self, goal, record):
        made = record.decision
        self.record(
            Decided, round(self.t * 1e9), goal=goal, image_ns=record.image_stamp_ns,
            estimate_ns=record.estimate_stamp_ns, step=record.step, action=made.action,
            probabilities=made.probabilities, collision_probability=made.collision_probability,
            detection_score=made.detection_score, vetoed=record.vetoed,
            met_before=record.met_before,
        )  # fmt: skip


def without(events, dropped):
    """The events for which ``dropped`` is false."""
    return [event for event in events if not dropped(event)]


def later(events, moved, seconds):
    """The events with some of them recorded later by so many seconds."""
    ns = round(seconds * 1e9)
    shifted = [
        dataclasses.replace(event, log_ns=event.log_ns + ns) if moved(event) else event
        for event in events
    ]
    return sorted(shifted, key=lambda event: event.log_ns)
