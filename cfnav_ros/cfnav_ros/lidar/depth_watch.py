"""Depth as a second guard: pictures in time, and the larger of two probabilities. Pure.

The LiDAR sees one plane; depth sees what reaches over it. ``DepthWatch.joined`` states the rule of
both: the probability is the larger, the clearance the smaller. Depth never makes a motion safer, so
pictures that are late, blind, from a rival or not there change nothing, and are said.

The chance that the body meets what depth shows is that of the LiDAR's error model with the errors
of depth in place of those of ranges. Where the nearest thing in the way is a level surface that the
lower edge of the picture has cut off, at a way w, its own edge lies anywhere on that way: a motion
of length s < w meets it with chance s / w.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cfnav_core.task.pinhole import Pinhole
from cfnav_ros.lidar.depth_memory import DepthMemory, DepthParameters, Place, body
from cfnav_ros.lidar.estimate import Estimate, SweptDisc
from cfnav_ros.lidar.frames import FrameTree
from cfnav_ros.lidar.mounting import told_twice
from cfnav_ros.lidar.sweep import ErrorModel, free_way, seen_probability
from cfnav_ros.robot.depths import cloud_to_metres, depth_to_metres, thinning
from cfnav_ros.robot.speakers import OneSpeaker, Speaker
from cfnav_ros.robot.stamps import FUTURE_S

LEAST_KNOWN = 0.01
"""A smaller share of the pixels that measure something is a covered lens, or no light."""

TURNED_RAD = 0.01
"""A camera that turned by no more between two pictures rests: TF is not of their very moment."""

JUMP_M, JUMP_RAD = 0.3, 0.5
"""Odometry that moves so far between two messages was reset: what was seen is somewhere else."""

HISTORY = 100
"""Odometry kept to place pictures: 5 s at 20 Hz."""

PENDING = 3
"""Pictures kept until odometry of their time has come."""


class DepthWatch:
    """Keeps what depth shows and joins it with the LiDAR's estimates.

    Args:
        parameters: of depth.
        frozen: how long pictures may stay the same to the last bit, seconds; 0: for ever.
        disc: radius, step and margin of the motion.
        errors: of the motion.
        tree: frames of TF.
        base: frame of the robot.
    """

    def __init__(
        self,
        parameters: DepthParameters,
        frozen: float,
        disc: SweptDisc,
        errors: ErrorModel,
        tree: FrameTree,
        base: str,
    ) -> None:
        self._parameters, self._frozen = parameters, frozen
        self._disc, self._errors, self._tree, self._base = disc, errors, tree, base
        self._parts = body(parameters, disc.radius)
        self._memory = DepthMemory(self._parts, parameters)
        self._camera: Pinhole | None = None
        self._places: deque[Place] = deque(maxlen=HISTORY)
        self._pending: deque[tuple[float, Any]] = deque(maxlen=PENDING)
        self._pose: np.ndarray | None = None
        self._speaker = OneSpeaker("depth", "")
        self._rivals = ""
        self._newest = -math.inf
        self._same, self._same_since = b"", -math.inf
        self._wrong = "No depth picture has arrived."
        self.known = 0.0
        """Share of the newest picture's pixels that measured something."""

    def publishers(self, speakers: Sequence[Speaker], met: int = 0) -> None:
        """Hear who publishes depth; while it is not one alone, pictures are not looked at.

        ``met`` as in ``OneSpeaker.look``.
        """
        self._rivals = self._speaker.look(speakers, met)
        if self._rivals:
            self._pending.clear()
        if self._rivals and len(speakers) == 1:
            self._speaker.forget()  # it took the place of another; its next pictures are believed

    def calibration(self, camera: Pinhole) -> None:
        """Hear how the camera sees."""
        self._camera = camera

    def odometry(self, stamp: float, x: float, y: float, yaw: float) -> None:
        """Hear where the robot is: seconds, metres, metres, radians.

        What repeats or comes late is left out; a leap, or a clock that starts again, forgets all.
        """
        way = 0.0
        if self._places:
            last = self._places[-1]
            if last.stamp - FUTURE_S <= stamp <= last.stamp:
                return
            driven = math.hypot(x - last.x, y - last.y)
            turned = math.remainder(yaw - last.yaw, math.tau)
            if stamp < last.stamp or driven > JUMP_M or abs(turned) > JUMP_RAD:
                self._places.clear()
                self._memory.forget()
            way = last.way + driven
        self._places.append(Place(stamp, x, y, yaw, way))

    def picture(self, stamp: float, message: Any) -> None:
        """Hear a picture or a cloud of points; it is looked at later.

        Args:
            stamp: seconds.
            message: with the fields of sensor_msgs/Image or PointCloud2.
        """
        self._pending.append((stamp, message))

    def joined(self, now: float, stamp: float, estimate: Estimate) -> Estimate:
        """The LiDAR's estimate and what depth shows: probability the larger, clearance the smaller.

        Args:
            now: node time, seconds.
            stamp: of the scan, seconds: the estimate holds for the robot's place then.
            estimate: of the LiDAR.
        """
        self._look(now)
        place = self._at(min(stamp, self._places[-1].stamp)) if self._places else None
        if place is None:
            return estimate
        free, way, height = 1.0, math.inf, 0.0
        for part, there in zip(self._parts, self._memory.stands(place), strict=True):
            flat, step = there.points[:, :2], self._disc.step
            ways = free_way(flat, part.radius)
            free *= 1.0 - seen_probability(flat, there.error, part.radius, step, self._errors)
            if not len(ways) or math.isinf(ways.min()):
                continue
            nearest = ways.argmin()
            if there.cut[nearest]:
                free *= 1.0 - min(step / max(float(ways[nearest]), step), 1.0)
            if ways[nearest] < way:
                way, height = float(ways[nearest]), float(there.points[nearest, 2])
        clearance = min(estimate.clearance, max(way - self._disc.margin, 0.0))
        estimate = replace(estimate, clearance=clearance)
        if 1.0 - free <= estimate.probability:
            return estimate
        shown = f"Depth shows something {way:.2f} m ahead, {height:.2f} m up."
        reason = f"{estimate.reason} {shown}".strip()
        return replace(estimate, probability=1.0 - free, reason=reason)

    def fault(self, now: float) -> str:
        """Why depth shows nothing new at node time now (seconds), one sentence; else empty."""
        wrong, age = self._rivals or self._wrong, now - self._newest
        if wrong or -FUTURE_S <= age <= self._parameters.stale:
            return wrong
        return f"The newest depth picture is {age:.1f} s old."

    def _look(self, now: float) -> None:
        """Look at the newest picture that odometry has come for."""
        until = self._places[-1].stamp if self._places else -math.inf
        placed = [picture for picture in self._pending if picture[0] <= until]
        if placed:
            waiting = [picture for picture in self._pending if picture[0] > until]
            self._pending = deque(waiting, maxlen=PENDING)
            if not self._rivals:
                self._wrong = self._see(now, *placed[-1])
        elif len(self._pending) == PENDING:
            self._wrong = (
                "No odometry is of the time of the depth pictures: does it arrive, and do the "
                "clocks of camera and base agree?"
            )

    def _see(self, now: float, stamp: float, message: Any) -> str:
        """Look at a picture; returns what is wrong, one sentence, empty when nothing is."""
        age = now - stamp
        if not -FUTURE_S <= age <= self._parameters.stale:
            return f"The newest depth picture is {age:.1f} s old."
        try:
            depth, camera = self._measured(message)
        except ValueError as error:
            return str(error)
        self._newest = stamp
        self.known = float(np.mean(depth > 0))
        if fault := self._unseeing(stamp, message):
            return fault
        if twice := self._tree.contradicted(self._base, camera.frame):
            return told_twice(twice)
        pose = self._tree.pose(self._base, camera.frame)
        if pose is None:
            return _apart(self._base, camera.frame)
        before, self._pose = self._pose, pose
        place = self._at(stamp)
        if place is None:
            return "The depth picture is older than all odometry that is kept."
        if before is not None and _rests(before, pose):
            self._memory.see(depth, camera, pose, place)
        return ""

    def _measured(self, message: Any) -> tuple[np.ndarray, Pinhole]:
        """Depth [H, W] of a picture or a cloud, metres, and the camera that sees it so.

        Raises:
            ValueError: it cannot be told; one sentence.
        """
        camera = self._camera
        if camera is None:
            raise ValueError("Nobody says how the depth camera sees: publish its camera_info.")
        size = f"{camera.width}x{camera.height}"
        if camera.fov_deg is None:
            raise ValueError(
                f"The depth camera's calibration has focal lengths {camera.fx:g} and {camera.fy:g} "
                f"for {size} pixels, expected positive numbers: calibrate it."
            )
        every = thinning(camera.width)
        frame = message.header.frame_id or camera.frame
        if hasattr(message, "point_step"):
            camera = replace(camera.thinned(every), frame=camera.frame or frame)
            between = self._tree.pose(camera.frame, frame)
            if between is None:
                raise ValueError(_apart(camera.frame, frame))
            return cloud_to_metres(message, camera, between), camera
        if (message.width, message.height) != (camera.width, camera.height):
            raise ValueError(
                f"The depth picture is {message.width}x{message.height}, but its camera_info says "
                f"{size}."
            )
        return depth_to_metres(message, every), replace(camera.thinned(every), frame=frame)

    def _unseeing(self, stamp: float, message: Any) -> str:
        if self.known < LEAST_KNOWN:
            return (
                f"{self.known:.0%} of the depth picture's pixels measure something, expected at "
                f"least {LEAST_KNOWN:.0%}: is the lens covered, or a wall too near?"
            )
        pixels = bytes(message.data)
        if pixels != self._same or stamp < self._same_since:
            self._same, self._same_since = pixels, stamp
        stood = stamp - self._same_since
        if not 0 < self._frozen < stood:
            return ""
        return f"The depth picture has not changed in {stood:.1f} s: start its driver again."

    def _at(self, stamp: float) -> Place | None:
        """Where the robot was at a time, between two messages of odometry; None when unknown."""
        after = next((p for p in self._places if p.stamp >= stamp), None)
        before = next((p for p in reversed(self._places) if p.stamp <= stamp), None)
        if before is None or after is None:
            return None
        span = after.stamp - before.stamp
        share = (stamp - before.stamp) / span if span > 0 else 0.0
        yaw = before.yaw + share * math.remainder(after.yaw - before.yaw, math.tau)
        x, y, way = (
            a + share * (b - a)
            for a, b in ((before.x, after.x), (before.y, after.y), (before.way, after.way))
        )
        return Place(stamp, x, y, yaw, way)


def _apart(base: str, frame: str) -> str:
    return f"TF does not join {base} and {frame}: publish where the camera sits."


def _rests(before: np.ndarray, now: np.ndarray) -> bool:
    """Whether a camera looked the same way from its robot at two times."""
    turn = (np.trace(before[:3, :3].T @ now[:3, :3]) - 1.0) / 2.0
    return math.acos(min(max(float(turn), -1.0), 1.0)) <= TURNED_RAD
