"""What the LiDAR collision node says about itself once a second. Pure: numbers in, words out."""

from __future__ import annotations

from collections import deque

import numpy as np

from cfnav_ros.lidar.estimate import Estimate

KEPT = 100
"""Scans that rate and processing time are taken over."""


class ScanStats:
    """Rate of the scans and how long each took."""

    def __init__(self) -> None:
        self._stamps: deque[float] = deque(maxlen=KEPT)
        self._took: deque[float] = deque(maxlen=KEPT)

    def add(self, stamp: float, took: float) -> None:
        """Take one scan: its stamp and the time spent on it, seconds."""
        self._stamps.append(stamp)
        self._took.append(took)

    def values(self, estimate: Estimate, age: float, source: str) -> dict[str, str]:
        """Key-values for a diagnostic status.

        Args:
            estimate: published last.
            age: of the newest scan, seconds from the end of its turn.
            source: of the mounting.
        """
        return {
            "probability": f"{estimate.probability:.3f}",
            "clearance_m": f"{estimate.clearance:.3f}",
            "known_fraction": f"{estimate.known_fraction:.3f}",
            "unknown_arc_deg": f"{estimate.unknown_arc:.1f}",
            "scan_rate_hz": f"{self.rate():.2f}",
            "scan_age_s": f"{age:.2f}",
            "processing_p50_ms": f"{self.took_ms(50):.2f}",
            "processing_p99_ms": f"{self.took_ms(99):.2f}",
            "mount": source or "none",
        }

    def rate(self) -> float:
        """Scans per second of their own stamps; 0 before the second, or when stamps stand still."""
        span = self._stamps[-1] - self._stamps[0] if len(self._stamps) > 1 else 0.0
        return (len(self._stamps) - 1) / span if span > 0 else 0.0

    def took_ms(self, percentile: float) -> float:
        """Percentile of the processing time, milliseconds; 0 before the first scan."""
        return float(np.percentile(self._took, percentile)) * 1e3 if self._took else 0.0
