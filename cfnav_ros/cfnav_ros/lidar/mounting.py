"""How the LiDAR is mounted: from TF or parameters, and whether its own view agrees. Pure."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from cfnav_ros.lidar.frames import FrameTree, planar_mount
from cfnav_ros.lidar.returns import Mount, Scan, beams, measured

MOUNT = ("robot", "disc.mount_x", "disc.mount_y", "disc.mount_yaw_deg")
"""Parameters that say where the LiDAR sits."""

AGREE_M, AGREE_DEG = 0.02, 3.0
"""TF and parameters that differ by no more say the same."""

CORE_DEG = 1.5
"""Around its bearing even the thinnest of the robot's posts hides at least this much."""

SEEN_THROUGH = 10
"""Successive scans that must look through the robot's own parts: one may be a ghost."""


class Mounting:
    """Chooses the mounting of the scanner a scan comes from."""

    def __init__(
        self, source: str, parameters: Mount | None, given: bool, base: str, frame: str
    ) -> None:
        """Know what was configured.

        Args:
            source: auto (TF where it joins the frames, else parameters), tf or parameters.
            parameters: the mounting that the parameters say; None when they speak of another
                scanner.
            given: whether somebody set them, so that TF must not contradict them.
            base: frame of the robot.
            frame: that scans must come from; empty: any.
        """
        self.tree = FrameTree()
        self._source, self._parameters, self._given = source, parameters, given
        self._base, self._frame = base, frame
        self._believed: Mount | None = None
        self._joined = ""

    def choose(self, frame: str) -> tuple[Mount | None, str, str]:
        """The mounting of the scanner in a frame.

        Returns:
            (the mounting, None when there is none to trust; where it comes from, "TF" or
            "parameters"; what is wrong in one sentence, empty when nothing is).
        """
        if self._frame and frame.lstrip("/") != self._frame.lstrip("/"):
            fault = (
                f"The scan comes from frame {frame!r}, expected {self._frame!r}: end the other "
                "scanner or set the parameter frame."
            )
            return None, "", fault
        if self._source == "parameters":
            return self._said(frame)
        if twice := self.tree.contradicted(self._base, frame):
            return None, "", told_twice(twice)
        pose = self.tree.pose(self._base, frame)
        if pose is None and self._joined == frame:
            fault = (
                f"TF joined {self._base} and {frame} before and does not now: end the publisher "
                "that is wrong, then start the LiDAR node again."
            )
            return None, "", fault
        if pose is None:
            if self._source == "auto":
                return self._said(frame)
            return None, "", f"TF does not join {self._base} and {frame} yet."
        try:
            mount = planar_mount(pose)
        except ValueError as error:
            return None, "", str(error)
        said = self._parameters
        if self._source == "auto" and self._given and said and not agree(mount, said):
            fault = (
                f"TF puts the LiDAR at {told(mount)}, the parameters at {told(said)}: "
                "mend one, or set the parameter mount to tf or parameters."
            )
            return None, "", fault
        if self._believed is None:
            self._believed, self._joined = mount, frame
        if not agree(mount, self._believed):
            fault = (
                f"TF put the LiDAR at {told(self._believed)} before and puts it at {told(mount)} "
                "now: end the publisher that is wrong, then start the LiDAR node again."
            )
            return None, "", fault
        return mount, "TF", ""

    def _said(self, frame: str) -> tuple[Mount | None, str, str]:
        if self._parameters is not None:
            return self._parameters, "parameters", ""
        fault = (
            f"Nobody says where the LiDAR of frame {frame!r} sits: publish it on TF, or set robot, "
            "or disc.mount_x, disc.mount_y and disc.mount_yaw_deg."
        )
        return None, "", fault


def agree(a: Mount, b: Mount) -> bool:
    """Whether two mountings are the same but for inaccuracy of a description."""
    apart = math.hypot(a.x - b.x, a.y - b.y)
    turned = abs(math.remainder(a.yaw - b.yaw, math.tau))
    return apart <= AGREE_M and turned <= math.radians(AGREE_DEG) and a.upside_down == b.upside_down


def told(mount: Mount) -> str:
    """A mounting in words."""
    hung = ", upside down" if mount.upside_down else ""
    return f"({mount.x:.3f}, {mount.y:.3f}) m, yaw {math.degrees(mount.yaw):.0f} degrees{hung}"


def told_twice(frame: str) -> str:
    """What is wrong with a frame of ``FrameTree.contradicted``."""
    return (
        f"TF has two places for {frame}, one of them in tf_static: end the publisher that is "
        "wrong, then start the LiDAR node again."
    )


class OwnParts:
    """Looks for the robot's own posts where the mounting says that they stand.

    They stand nearer than the scanner measures, or within the hull, and hide what is behind them.
    When beams at the middle of most of them keep returning from beyond the hull, the scanner is
    turned against its mounting, or turns the wrong way about its own axis, which swaps front and
    rear here. A scan with left and right swapped goes unnoticed: the posts stand alike on both
    sides.
    """

    def __init__(self, bearings: tuple[float, ...], radius: float) -> None:
        """Know the bearings of the parts, radians in base_link, and the hull's radius, metres."""
        self._bearings, self._radius = bearings, radius
        self._through: deque[bool] = deque(maxlen=SEEN_THROUGH)
        self._seen_once = False

    def look(self, scan: Scan, mount: Mount) -> str:
        """Take one well-formed scan; what is wrong in one sentence, empty when nothing is."""
        if not self._bearings:
            return ""
        ranges, half = np.asarray(scan.ranges), math.radians(CORE_DEG)
        there = beams(
            ranges.size, scan.angle_min, scan.angle_increment, mount, self._bearings, half,
            self._radius,
        )  # fmt: skip
        cores, beyond = there.parts, measured(ranges, scan) & (ranges > there.hull)
        through = int((2 * (cores & beyond).sum(1) > cores.sum(1)).sum())
        self._through.append(2 * through > len(cores))
        self._seen_once |= not self._through[-1]
        # Until the parts were seen once there is nothing that speaks for the mounting.
        patience = SEEN_THROUGH if self._seen_once else 1
        if len(self._through) < patience or not all(self._through):
            return ""
        return (
            f"The LiDAR sees through {through} of the robot's {len(cores)} own parts: it is not "
            "mounted as said, or the parts of disc.mask_bearings_deg are not there."
        )
