"""Whether a sensor that repeats itself is frozen: one rule for the robot and for bags. Pure.

A sensor whose messages differ while the robot stands has noise; if it then repeats one bit by bit,
it is frozen. One that repeats itself while the robot stands may be drawn without noise, as
simulated ones are: it is frozen only if the robot moves meanwhile. To it a view in which something
moves by itself is noise.
"""

from __future__ import annotations

import math

from cfnav_ros.drive.motion import wrap

REST_S = 0.5
"""How long a pose must have stood for two messages to be of the same view."""

SAME_M, SAME_RAD = 0.002, math.radians(0.2)
"""A pose that changes less shows the same view, up to the sensor's noise."""

MOVED_M, MOVED_RAD = 0.03, math.radians(3.0)
"""A pose that changed more shows another view, even to a sensor without noise."""

LAG_S = 0.1
"""Odometry this much newer than a message, or less, is of the same place."""

NOISY = 5
"""Messages of one view that differ: a robot that is put down elsewhere changes only one."""

Pose = tuple[float, ...]
"""x and y, m; then angles that change what is seen, rad: yaw, or yaw and tilt."""


class Repeats:
    """Follows one sensor.

    Attributes:
        since: when it first sent what it still sends, seconds.
        frozen: whether what it repeats since then can only come from a frozen sensor.
    """

    def __init__(self) -> None:
        self.since = 0.0
        self.frozen = False
        self._pose: Pose | None = None
        self._rest: tuple[float, Pose | None] = (0.0, None)
        self._different = 0
        self._stamp_ns = 0

    def see(self, t: float, stamp_ns: int, same: bool, pose: Pose | None, pose_t: float) -> None:
        """Take a message; one that is delivered again under its stamp says nothing.

        Args:
            t: when it was made, seconds.
            stamp_ns: its stamp, nanoseconds.
            same: whether it holds what the one before held; False for the first.
            pose: newest odometry; without one every view counts as one of a robot at rest.
            pose_t: when that was taken, seconds. Odometry that is newer than the message says
                nothing of where it was taken.
        """
        if same and stamp_ns == self._stamp_ns:
            return
        self._stamp_ns = stamp_ns
        rested_at = self._rest[1]
        if _apart(pose, rested_at, SAME_M, SAME_RAD) or (pose is None) != (rested_at is None):
            self._rest = (t, pose)
        if not same:
            self._different += pose is None or t - self._rest[0] > REST_S
            self.since, self._pose, self.frozen = t, pose, False
            return
        noisy = self._different >= NOISY
        if not noisy:
            self._different = 0
        moved = pose_t - t <= LAG_S and _apart(pose, self._pose, MOVED_M, MOVED_RAD)
        self.frozen = noisy or moved


def _apart(a: Pose | None, b: Pose | None, metres: float, radians: float) -> bool:
    """Whether two poses differ by more than so much; without one they do not."""
    if a is None or b is None:
        return False
    turned = max(abs(wrap(p - q)) for p, q in zip(a[2:], b[2:], strict=True))
    return math.hypot(a[0] - b[0], a[1] - b[1]) > metres or turned > radians
