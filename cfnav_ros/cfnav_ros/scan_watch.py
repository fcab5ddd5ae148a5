"""Scans in time: late, repeated, frozen and missing scans are BLIND. Pure: time is an argument."""

from __future__ import annotations

import numpy as np

from cfnav_ros.inputs import FUTURE_S
from cfnav_ros.lidar import Estimate, Scan, SweptDisc, blind, estimate_collision
from cfnav_ros.mounting import Mounting, OwnParts
from cfnav_ros.returns import malformed
from cfnav_ros.sweep import ErrorModel


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
            stale: age from which a scan says nothing about now, seconds.
            frozen: how long ranges may stay the same to the last bit, seconds; 0: for ever.
            mounting: of the scanner.
            disc: geometry and thresholds of the estimate.
            errors: its error model.
        """
        self._stale, self._frozen, self._mounting = stale, frozen, mounting
        self._disc, self._errors = disc, errors
        self._own_parts = OwnParts(disc.mask_bearings)
        self._newest: float | None = None
        self._same = b""
        self._same_since = 0.0
        self._before: np.ndarray | None = None
        self._rivals = ""
        self.source = ""

    def publishers(self, names: list[str]) -> None:
        """Hear which nodes publish scans now."""
        self._rivals = ""
        if len(names) > 1:
            self._rivals = (
                f"{len(names)} nodes publish scans ({', '.join(sorted(names))}), expected one: end "
                "the others."
            )

    def scan(self, now: float, stamp: float, scan: Scan) -> tuple[Estimate, bool]:
        """Judge a scan that has just arrived.

        Args:
            now: node time, seconds.
            stamp: of the scan, seconds.
            scan: its fields.

        Returns:
            (the estimate, whether the stamp can be trusted).
        """
        before, self._before = self._before, None
        fault = self._untimely(now, stamp)
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
        if now - self._newest > self._stale:
            return blind(f"The newest scan is {now - self._newest:.2f} s old.")
        return None

    def age(self, now: float) -> float:
        """Of the newest scan at node time now, seconds; inf before the first."""
        return float("inf") if self._newest is None else now - self._newest

    def _untimely(self, now: float, stamp: float) -> str:
        if stamp > now + FUTURE_S:
            return f"The scan is stamped {stamp - now:.1f} s in the future."
        # A stamp further back than that is a clock that has started again.
        if self._newest is not None and self._newest - FUTURE_S <= stamp <= self._newest:
            how = "repeats" if stamp == self._newest else "is older than"
            return f"The scan's stamp {how} that of the scan before."
        self._newest = stamp
        if now - stamp > self._stale:
            return f"The newest scan is {now - stamp:.2f} s old."
        return ""

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
