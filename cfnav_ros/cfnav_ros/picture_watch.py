"""Whether the camera's pictures show anything new, or anything at all. Pure."""

from __future__ import annotations

import math

import numpy as np

from cfnav_core.perception import PerceptionError, check_size
from cfnav_ros.inputs import Frame, PictureCheck, Tilt, seconds
from cfnav_ros.motion import Odometry, wrap

REST_S = 0.5
"""How long a pose must have stood for two pictures to be of the same view."""

SAME_M, SAME_RAD = 0.002, math.radians(0.2)
"""A pose that changes less shows the same view, up to the camera's noise."""

MOVED_M, MOVED_RAD = 0.03, math.radians(3.0)
"""A pose that changed more shows another view, even to a camera without noise."""

LAG_S = 0.1
"""Odometry this much newer than a picture, or less, is of the same place."""

EMPTY_SPREAD = 2.0
"""Grey levels of 255 between the 5th and the 95th percentile of a picture's blocks: with less it
shows nothing. Noise of 5 levels leaves about 1; rendered views from closest in front of furniture
have 3 and more."""

LOOKED_AT = 100
"""Rows and columns that are enough to see that a picture is empty: every picture is looked at, and
the robot's velocities wait meanwhile."""

BLOCK = 10
"""Side of the blocks of pixels that are averaged first, so that noise is no content."""

NOISY = 5
"""Pictures of one view that differ: a robot that is put down elsewhere changes only one."""

NOWHERE = (math.inf, 0.0, 0.0, 0.0)


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


def unsuitable(height: int, width: int) -> str:
    """One sentence when the policy cannot use pictures of a size, else empty; pixels."""
    try:
        check_size(height, width)
    except PerceptionError as error:
        return f"The camera's pictures do not suit the policy: {error}."
    return ""


class PictureWatch:
    """Looks at every picture that arrives.

    A camera whose pictures differ while the robot stands has noise; if it then repeats one byte by
    byte for ``frozen_time``, it is frozen. One that repeats itself while the robot stands may be
    drawn without noise, as simulated ones are: it is frozen only if the robot moves meanwhile. To
    it a view in which something moves by itself is noise: a simulator without noise needs 0.
    """

    def __init__(self, frozen_time: float) -> None:
        """Watch pictures.

        Args:
            frozen_time: stamps may advance by this much over one picture, seconds; 0 is for ever.
        """
        self._frozen_time = frozen_time
        self._frame: Frame | None = None
        self._check = PictureCheck()
        self._first, self._first_pose = 0.0, NOWHERE
        self._rest_from, self._rest_pose = 0.0, NOWHERE
        self._different = 0

    def look(self, frame: Frame, odometry: Odometry, tilt: Tilt) -> PictureCheck:
        """Judge a picture that has just arrived.

        Args:
            frame: the picture; its pixels are judged here, its age elsewhere.
            odometry: newest pose.
            tilt: newest tilt of the camera.
        """
        stamp = seconds(frame.stamp_ns)
        angle = tilt.angle if math.isfinite(tilt.angle) else 0.0
        pose = (odometry.x, odometry.y, odometry.yaw, angle)
        if _apart(pose, self._rest_pose, SAME_M, SAME_RAD):
            self._rest_from, self._rest_pose = stamp, pose
        before, self._frame = self._frame, frame
        if before is None or frame.data is None or frame.data != before.data:
            if stamp - self._rest_from > REST_S:
                self._different += 1
            self._first, self._first_pose = stamp, pose
            self._check = self._read(frame)
            return self._check
        if self._different < NOISY:
            self._different = 0
        if self._check.waiting or not self._frozen_time:
            return self._check
        # Odometry that is newer than the picture says nothing of where it was taken.
        moved = odometry.stamp - stamp <= LAG_S and _apart(
            pose, self._first_pose, MOVED_M, MOVED_RAD
        )
        return self._repeated(stamp, seconds(before.stamp_ns), moved)

    def _repeated(self, stamp: float, before: float, moved: bool) -> PictureCheck:
        lasted = stamp - self._first
        # By the next picture the time will have passed.
        due = lasted + (stamp - before) > self._frozen_time
        if not due or not (moved or self._different >= NOISY):
            return self._check
        return PictureCheck(
            waiting=f"The camera is frozen: it has sent one picture for {lasted:.1f} s under new "
            "stamps. Start its driver again."
        )

    def _read(self, frame: Frame) -> PictureCheck:
        fault = unsuitable(frame.height, frame.width)
        if fault:
            return PictureCheck(fault=fault)
        every = max(min(frame.height, frame.width) // LOOKED_AT, 1)
        try:
            return PictureCheck(waiting=emptiness(frame.decode(every)))
        except ValueError as error:
            return PictureCheck(fault=str(error))


def _apart(a: tuple[float, ...], b: tuple[float, ...], metres: float, radians: float) -> bool:
    """Whether two poses (x, y, yaw, tilt) differ by more than so much."""
    turned = max(abs(wrap(a[2] - b[2])), abs(a[3] - b[3]))
    return math.hypot(a[0] - b[0], a[1] - b[1]) > metres or turned > radians
