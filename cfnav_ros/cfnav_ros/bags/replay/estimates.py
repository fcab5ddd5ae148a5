"""Recorded scans -> the collision estimates that the live LiDAR node would have published. Pure.

The same ``ScanWatch`` and ``Mounting`` judge, in the node's time: that of /clock once the bag tells
it, else the log time. Three things of the live node are not in a bag: when its timer fired, so
blind estimates in silence may differ by one period of it; which nodes published scans; and depth,
without which a probability is the LiDAR's alone.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from cfnav_ros.bags.files.events import Event, Frames, Judged, LaserTurn, Pose, Tick
from cfnav_ros.lidar.estimate import Estimate, Verdict
from cfnav_ros.lidar.returns import Mount
from cfnav_ros.lidar.scan_watch import LidarParameters, ScanWatch

TOPIC = "collision/estimate"
"""Of estimates that were made again."""

KEEP_NS = 10_000_000_000
"""Estimates older than this cannot be found any more: a decision takes less."""

MOST_KEPT = 400

LEAP_NS = 10_000_000_000
"""Of a longer time without any event only so much is filled with blind estimates, and its end."""


AHEAD_NS = 2_000_000_000
"""A recorder that is busy hears /clock so much later than it should; odometry that is stamped
further ahead comes from another clock."""


class NodeTime:
    """Time as the robot's nodes had it, integer nanoseconds.

    That of /clock once the bag tells it, else the log time. Where /clock was recorded late, the
    stamps of odometry, which are those of the moment, are ahead of it and tell the time; without
    /clock they may come from a base whose clock is ahead.
    """

    def __init__(self) -> None:
        self._ticked: int | None = None
        self._moved = 0

    def at(self, event: Event) -> int:
        """The time at which an event came; events are given in their order."""
        if isinstance(event, Tick):
            self._ticked = event.t_ns
        if isinstance(event, Pose):
            self._moved = event.t_ns
        if self._ticked is None:
            return event.log_ns
        return self._moved if 0 < self._moved - self._ticked <= AHEAD_NS else self._ticked


@dataclass(frozen=True)
class _Published:
    now_ns: int
    judged: Judged
    of_scan: bool


class Estimates:
    """Judges the scans of one bag.

    Its estimates are stamped in node time and logged in that of the bag.

    Attributes:
        newest: node time of the last estimate, and the estimate; None before the first.
    """

    def __init__(
        self, parameters: LidarParameters | None = None, mount_given: bool = False
    ) -> None:
        """Prepare.

        Args:
            parameters: of the LiDAR node, its defaults when None.
            mount_given: whether somebody set the mounting in them, so that TF must not
                contradict it.
        """
        self._parameters = p = parameters or LidarParameters()
        self._mounting = p.mounting(mount_given)
        self._watch = ScanWatch(p.stale, p.frozen, self._mounting, p.disc, p.errors)
        self._period_ns = round(1e9 / p.stale_rate)
        self._time = NodeTime()
        self._now_ns: int | None = None
        self._log_ns = 0
        self._due_ns = 0
        self._kept: deque[_Published] = deque(maxlen=MOST_KEPT)
        self.newest: tuple[int, Judged | None] = (0, None)

    def see(self, event: Event) -> list[Judged]:
        """The estimates that the node published since the last event and because of this one."""
        now_ns = self._time.at(event)
        found = []
        for due_ns in self._timer(now_ns):
            estimate = self._watch.silence(due_ns * 1e-9)
            if estimate is not None:
                # where both clocks run differently, not before what was logged last
                log_ns = max(event.log_ns - (now_ns - due_ns), self._log_ns)
                found.append(self._publish(due_ns, due_ns, log_ns, estimate))
        self._now_ns, self._log_ns = now_ns, event.log_ns
        if isinstance(event, Frames):
            self._hear(event)
        elif isinstance(event, LaserTurn):
            stamp = event.t_ns * 1e-9
            estimate, timely = self._watch.scan(now_ns * 1e-9, stamp, event.scan)
            stamp_ns = event.t_ns if timely else now_ns
            found.append(self._publish(now_ns, stamp_ns, event.log_ns, estimate, timely))
        return found

    def mount_of(self, frame: str) -> Mount | None:
        """The mounting that is believed of the scanner in a frame, None while none is."""
        return self._mounting.choose(frame)[0]

    def made_from(self, stamp_ns: int) -> Judged | None:
        """The estimate made from the scan with a stamp; None when none of late has it."""
        found = (p.judged for p in reversed(self._kept) if p.of_scan)
        return next((judged for judged in found if judged.t_ns == stamp_ns), None)

    def blind_at(self, now_ns: int) -> Judged | None:
        """The blind estimate that held at a node time, None when the LiDAR saw then.

        The live node's timer may have fired up to a period before the replayed one.
        """
        until_ns = now_ns + self._period_ns
        held = next((p.judged for p in reversed(self._kept) if p.now_ns <= until_ns), None)
        return held if held and held.estimate.verdict is Verdict.BLIND else None

    def _timer(self, now_ns: int) -> Iterator[int]:
        """When the node's timer fired since the last event."""
        before_ns, period_ns = self._now_ns, self._period_ns
        if before_ns is None or now_ns < before_ns:
            self._due_ns = now_ns + period_ns
        elif now_ns - before_ns > LEAP_NS:
            yield from range(self._due_ns, before_ns + LEAP_NS, period_ns)
            yield now_ns
            self._due_ns = now_ns + period_ns
        while self._due_ns <= now_ns:
            yield self._due_ns
            self._due_ns += period_ns

    def _hear(self, event: Frames) -> None:
        # as the node does: once the way to the scanner is known, only what is static matters
        if self._parameters.mount == "parameters":
            return
        if self._watch.source == "TF" and not event.topic.endswith("tf_static"):
            return
        for transform in event.transforms:
            self._mounting.tree.add(*transform, fixed=event.topic.endswith("tf_static"))

    def _publish(
        self, now_ns: int, stamp_ns: int, log_ns: int, estimate: Estimate, of_scan: bool = False
    ) -> Judged:
        judged = Judged(t_ns=stamp_ns, log_ns=log_ns, topic=TOPIC, estimate=as_published(estimate))
        self._kept.append(_Published(now_ns, judged, of_scan))
        while now_ns - self._kept[0].now_ns > KEEP_NS:
            self._kept.popleft()
        self.newest = now_ns, judged
        return judged


def as_published(estimate: Estimate) -> Estimate:
    """An estimate as it arrives: cfnav_interfaces/CollisionEstimate has float32 numbers."""
    return replace(
        estimate,
        probability=float(np.float32(estimate.probability)),
        clearance=float(np.float32(estimate.clearance)),
        known_fraction=float(np.float32(estimate.known_fraction)),
    )
