"""Scans in time: late, repeated and missing scans are BLIND. Pure: time is an argument."""

from __future__ import annotations

from cfnav_ros.inputs import FUTURE_S
from cfnav_ros.lidar import Estimate, Scan, SweptDisc, blind, estimate_collision


class ScanWatch:
    """Turns each scan into an estimate, and silence into BLIND ones."""

    def __init__(self, stale: float, disc: SweptDisc) -> None:
        """Watch for scans.

        Args:
            stale: age from which a scan says nothing about now, seconds.
            disc: geometry and thresholds of the estimate.
        """
        self._stale, self._disc = stale, disc
        self._newest: float | None = None

    def scan(self, now: float, stamp: float, scan: Scan) -> Estimate | None:
        """Judge a scan that has just arrived.

        Args:
            now: node time, seconds.
            stamp: of the scan, seconds.
            scan: its fields.

        Returns:
            The estimate; None for a scan that is no newer than the one before.
        """
        if stamp > now + FUTURE_S:
            return blind(f"The scan is stamped {stamp - now:.1f} s in the future.")
        if self._newest is not None and self._newest - FUTURE_S <= stamp <= self._newest:
            return None
        self._newest = stamp
        return self.silence(now) or estimate_collision(scan, self._disc)

    def silence(self, now: float) -> Estimate | None:
        """The estimate to publish when no scan is fresh at node time now (seconds), else None."""
        if self._newest is None:
            return blind("No scan has arrived.")
        if now - self._newest > self._stale:
            return blind(f"The newest scan is {now - self._newest:.2f} s old.")
        return None
