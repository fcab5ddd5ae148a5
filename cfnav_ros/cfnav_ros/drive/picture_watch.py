"""Whether the camera's pictures show anything new, or anything at all. Pure."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from cfnav_core.perception.perception import PerceptionError
from cfnav_ros.drive.inputs import CameraFrame, PictureCheck, Tilt
from cfnav_ros.drive.motion import Odometry
from cfnav_ros.drive.repeats import Repeats
from cfnav_ros.robot.stamps import seconds

EMPTY_SPREAD = 2.0
"""Grey levels of 255 between the 5th and the 95th percentile of a picture's blocks: with less it
shows nothing. Noise of 5 levels leaves about 1; rendered views from closest in front of furniture
have 3 and more."""

LOOKED_AT = 100
"""Rows and columns that are enough to see that a picture is empty: every picture is looked at, and
the robot's velocities wait meanwhile."""

BLOCK = 10
"""Side of the blocks of pixels that are averaged first, so that noise is no content."""

CheckSize = Callable[[int, int], None]
"""Raises PerceptionError for pictures of a height and width, pixels, that cannot be used."""


def emptiness(rgb: np.ndarray) -> str:
    """One sentence when a picture shows nothing, else empty.

    Args:
        rgb: uint8 [H, W, 3].
    """
    side = min(BLOCK, *rgb.shape[:2])
    rows, columns = rgb.shape[0] // side, rgb.shape[1] // side
    blocks = rgb[: rows * side, : columns * side].reshape(rows, side, columns, side, 3)
    low, high = np.percentile(blocks.mean((1, 3, 4)), (5, 95))
    if high - low >= EMPTY_SPREAD:
        return ""
    return (
        f"The picture shows nothing (its grey levels differ by {high - low:.0f} of 255, expected "
        f"at least {EMPTY_SPREAD:.0f}): is the lens covered, is there light?"
    )


def unsuitable(check_size: CheckSize, height: int, width: int) -> str:
    """One sentence when the policy cannot use pictures of a size, else empty; pixels."""
    try:
        check_size(height, width)
    except PerceptionError as error:
        return f"The camera's pictures do not suit the policy: {error}."
    return ""


def _about(frame: CameraFrame) -> tuple[object, ...]:
    """What is known of a picture without its bytes: ``camera_info`` may change it."""
    return frame.fault, frame.waiting, frame.height, frame.width


class PictureWatch:
    """Looks at every picture that arrives; see ``repeats`` for when a camera is frozen."""

    def __init__(self, check_size: CheckSize | None, frozen_time: float) -> None:
        """Watch pictures, or what a detector says of them.

        Args:
            check_size: the policy's; None where it looks at detections.
            frozen_time: stamps may advance by this much over one picture, seconds; 0 is for ever.
        """
        self._check_size, self._frozen_time = check_size, frozen_time
        self._frame: CameraFrame | None = None
        self._told: CameraFrame | None = None
        self._check = PictureCheck()
        self._repeats = Repeats()

    def look(self, frame: CameraFrame, odometry: Odometry, tilt: Tilt) -> PictureCheck:
        """Judge a picture that has just arrived.

        Args:
            frame: the picture; its pixels are judged here, its age elsewhere.
            odometry: newest pose.
            tilt: newest tilt of the camera.
        """
        stamp = seconds(frame.stamp_ns)
        angle = tilt.angle if math.isfinite(tilt.angle) else 0.0
        pose = (odometry.x, odometry.y, odometry.yaw, angle)
        before, self._frame = self._frame, frame
        if frame.data is None:  # says nothing, so nothing of the sensor's noise either
            self._check = self._read(frame)
            return self._check
        told, self._told = self._told, frame
        same = told is not None and frame.data == told.data
        self._repeats.see(stamp, frame.stamp_ns, same, pose, odometry.stamp)
        if not same or before is None or _about(frame) != _about(before):
            self._check = self._read(frame)
        elif self._frozen_time and self._repeats.frozen and not self._check.waiting:
            return self._repeated(stamp, seconds(before.stamp_ns))
        return self._check

    def _repeated(self, stamp: float, before: float) -> PictureCheck:
        lasted = stamp - self._repeats.since
        # By the next picture the time will have passed.
        if lasted + (stamp - before) <= self._frozen_time:
            return self._check
        what = "The camera is frozen: it has sent one picture"
        if self._check_size is None:
            what = "The detector is frozen: it has sent one message"
        return PictureCheck(
            waiting=f"{what} for {lasted:.1f} s under new stamps. Start its driver again."
        )

    def _read(self, frame: CameraFrame) -> PictureCheck:
        if self._check_size is None:
            return PictureCheck(waiting=frame.waiting, fault=frame.fault)
        fault = frame.fault or unsuitable(self._check_size, frame.height, frame.width)
        if fault:
            return PictureCheck(fault=fault)
        every = max(min(frame.height, frame.width) // LOOKED_AT, 1)
        try:
            return PictureCheck(waiting=emptiness(frame.decode(every)))
        except ValueError as error:
            return PictureCheck(fault=str(error))
