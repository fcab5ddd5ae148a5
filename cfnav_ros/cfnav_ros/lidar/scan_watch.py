"""Scans in time: late, repeated, frozen and missing scans are BLIND. Pure: time is an argument."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from cfnav_core.robot.robot import MOUNTS, Robot, load_robot, robot_setting
from cfnav_core.robot.settings import setting
from cfnav_core.task.actions import STEP_M
from cfnav_ros.lidar.depth_memory import DepthParameters
from cfnav_ros.lidar.estimate import Estimate, Scan, SweptDisc, blind, estimate_collision
from cfnav_ros.lidar.mounting import Mounting, OwnParts
from cfnav_ros.lidar.returns import malformed
from cfnav_ros.lidar.sweep import ErrorModel
from cfnav_ros.robot.speakers import OneAfterAnother, Speaker
from cfnav_ros.robot.stamps import FUTURE_S

GRAPH_S = 0.2
"""How often to look at who publishes scans, real seconds: a rival is known within two scans."""

NEW_S = 1.0
"""How long scans of a new publisher are no sight, real seconds: a policy node that drives finds out
meanwhile that another one speaks."""

LONGEST_TURN_S = 0.2
"""The slowest of the supported scanners turns five times a second; a header that says more is not
believed, so that it cannot make old scans young."""


@dataclass(frozen=True)
class LidarParameters:
    """Parameters of ``lidar_collision_node``."""

    robot: str = robot_setting()
    stale: float = setting(0.4, "age, from its end, of a scan that is no sight, s", 0.05, 10.0)
    stale_rate: float = setting(10.0, "BLIND per second while stale", 1.0, 100.0)
    frozen: float = setting(
        1.0,
        "ranges that stay the same this long are no sight, s; 0: a noiseless simulator",
        0.0,
        3600.0,
    )
    mount: str = setting("auto", "mounting: auto (TF where it is there), tf or parameters")
    base_frame: str = setting("base_link", "frame of the robot in TF")
    frame: str = setting("rplidar_link", "frame that scans must come from; empty: any")
    disc: SweptDisc = field(default_factory=SweptDisc)
    errors: ErrorModel = field(default_factory=ErrorModel)
    depth: DepthParameters = field(default_factory=DepthParameters)

    @classmethod
    def of(cls, robot: Robot) -> LidarParameters:
        """What holds on a robot unless somebody says otherwise."""
        lidar = robot.lidar
        disc = SweptDisc(
            mount_x=lidar.x,
            mount_y=lidar.y,
            mount_yaw_deg=lidar.yaw_deg,
            radius=robot.radius,
            mask_bearings_deg=lidar.mask_bearings_deg,
            mask_half_width_deg=lidar.mask_half_width_deg,
        )
        depth = DepthParameters(
            height=robot.height, mast_height=robot.mast_height, mast_radius=robot.mast_radius
        )
        return cls(
            mount=lidar.mount, base_frame=robot.base_frame, frame=lidar.frame, disc=disc,
            depth=depth, errors=ErrorModel(bearing_bias_deg=lidar.bearing_bias_deg),
        )  # fmt: skip

    def mounting(self, given: bool) -> Mounting:
        """The scanner's, see ``Mounting``.

        Args:
            given: whether somebody set robot or one of ``disc.mount_*``. What a robot's file says
                holds for the scanner whose frame it names, so that it is not believed of another.
        """
        described = given or (self.frame and self.frame == load_robot(self.robot).lidar.frame)
        said = self.disc.mount if described else None
        return Mounting(self.mount, said, given, self.base_frame, self.frame)

    def __post_init__(self) -> None:
        if self.mount not in MOUNTS:
            raise ValueError(f"mount is {self.mount!r}, expected {', '.join(MOUNTS)}.")
        if self.disc.step != STEP_M:
            raise ValueError(
                f"disc.step is {self.disc.step:g}, expected {STEP_M}, which a MoveAhead drives."
            )


class ScanWatch:
    """Turns each scan into an estimate, and silence into BLIND ones.

    Attributes:
        source: where the last mounting that was trusted came from, "TF" or "parameters".
    """

    def __init__(
        self, stale: float, frozen: float, mounting: Mounting, disc: SweptDisc, errors: ErrorModel
    ) -> None:
        """Watch for scans.

        Args:
            stale: age from which a scan says nothing about now, seconds from the end of its turn.
            frozen: how long ranges may stay the same to the last bit, seconds; 0: for ever.
            mounting: of the scanner.
            disc: geometry and thresholds of the estimate.
            errors: its error model.
        """
        self._stale, self._frozen, self._mounting = stale, frozen, mounting
        self._disc, self._errors = disc, errors
        self._own_parts = OwnParts(disc.mask_bearings, disc.radius)
        self._newest: float | None = None
        self._ended = -math.inf
        self._same = b""
        self._same_since = 0.0
        self._before: np.ndarray | None = None
        self._speakers = OneAfterAnother("scans", "", NEW_S)
        self._rivals = ""
        self.source = ""

    def publishers(self, now: float, speakers: Sequence[Speaker], met: int = 0) -> None:
        """Hear who publishes scans at a real time, seconds; ``met`` as in ``OneSpeaker.look``."""
        self._rivals = self._speakers.look(now, speakers, met)

    def scan(self, now: float, stamp: float, scan: Scan) -> tuple[Estimate, bool]:
        """Judge a scan that has just arrived.

        Args:
            now: node time, seconds.
            stamp: of the scan, the beginning of its turn, seconds.
            scan: its fields.

        Returns:
            (the estimate, whether the stamp can be trusted).
        """
        before, self._before = self._before, None
        fault = self._untimely(now, stamp, scan)
        if fault:
            return blind(fault), False
        fault = self._rivals or malformed(scan) or self._unchanged(stamp, scan)
        mount = None
        if not fault:
            mount, source, fault = self._mounting.choose(scan.frame)
        if mount is not None:
            self.source = source
            fault = self._own_parts.look(scan, mount)
        if fault:
            return blind(fault), True
        estimate = estimate_collision(scan, self._disc, self._errors, mount, before)
        self._before = scan.ranges
        return estimate, True

    def silence(self, now: float) -> Estimate | None:
        """The estimate to publish when no scan is fresh at node time now (seconds), else None."""
        if self._newest is None:
            return blind("No scan has arrived.")
        fault = self._old(now)
        return blind(fault) if fault else None

    def age(self, now: float) -> float:
        """Of the newest scan at node time now, seconds from its end; inf before the first."""
        return now - self._ended

    def _untimely(self, now: float, stamp: float, scan: Scan) -> str:
        if stamp > now + FUTURE_S:
            return f"The scan is stamped {stamp - now:.1f} s in the future."
        # A stamp further back than that is a clock that has started again.
        if self._newest is not None and self._newest - FUTURE_S <= stamp <= self._newest:
            how = "repeats" if stamp == self._newest else "is older than"
            return f"The scan's stamp {how} that of the scan before."
        self._newest = stamp
        # What has arrived has ended, whatever its stamp says.
        self._ended = min(stamp + turn_time(scan), now)
        return self._old(now)

    def _old(self, now: float) -> str:
        age = self.age(now)
        if -FUTURE_S <= age <= self._stale:
            return ""
        return f"The newest scan is {age:.2f} s old."  # negative: the clock has stepped back

    def _unchanged(self, stamp: float, scan: Scan) -> str:
        ranges = np.asarray(scan.ranges).tobytes()
        if ranges != self._same or stamp < self._same_since:
            self._same, self._same_since = ranges, stamp
        stood = stamp - self._same_since
        if not 0 < self._frozen < stood:
            return ""
        return (
            f"The scan's ranges have not changed in {stood:.1f} s: restart the LiDAR (a simulator "
            "without noise needs frozen:=0.0)."
        )


def turn_time(scan: Scan) -> float:
    """Seconds from a scan's stamp to the end of its turn; 0 when its driver does not say."""
    taken = scan.scan_time
    return min(max(taken, 0.0), LONGEST_TURN_S) if math.isfinite(taken) else 0.0
