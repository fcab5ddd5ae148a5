"""Collisions of a recorded drive, by source; each source is a detector that is fed event by event.

========== ======================================================= =========================
source     what counts                                             who has it
========== ======================================================= =========================
truth      the simulator's collision counter rises                 simulators
bump       the bumper becomes pressed                              robots with a bumper
stall      the base is told to move and does not (``stalls.py``)   all with odometry
clearance  the LiDAR sees the hull's front touch, or nearly        robots with a LiDAR
========== ======================================================= =========================

Pure. ``observable`` joins bump and stall; clearance stands beside, as its plane sees no table top
and its margin of 1 cm is no touch.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from cfnav_ros.bags.files.events import Bumps, Judged, Pose, Truth
from cfnav_ros.drive.conduct import REFLEX_S
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.drive.track import BUMP_GAP_S
from cfnav_ros.lidar.estimate import Verdict

TRUTH, BUMP, STALL, CLEARANCE = "truth", "bump", "stall", "clearance"
SOURCES = (TRUTH, BUMP, STALL, CLEARANCE)

OBSERVABLE = "observable"
"""What ``observable`` gives: bump and stall together."""

SAME_TOUCH_S = REFLEX_S
"""A stall so near in time to a bump is the same touch: a base that was bumped backs off by itself
and hears no command for as long."""

BEFORE_S = 0.15
"""The speed at an impact is the largest of the odometry this long before it: three samples of a
Create 3, as the last may have been braked by the impact already."""

BEGINNING_S = 1.0
"""A bumper whose first report comes so soon after the bag's beginning may have been pressed before:
one that reports always has reported by then."""

REARMED_M = EpisodeLimits().guard_slack
"""Clearance from which the next touch is another one: by less a way may look too short."""


@dataclass(frozen=True)
class Contact:
    """One collision.

    Attributes:
        t_ns: when it began, nanoseconds.
        x: m, where the robot was: in the room for truth, else in the odometry frame.
        y: m.
        contact_with: what was touched, or the bumper zone that felt it; empty if unknown.
        count: collisions that began at once.
        yaw: rad, None if unknown.
        source: of ``SOURCES``.
        speed: m/s at the impact, None if unknown.
        block_s: over which the odometry was averaged that shows a stall, seconds.
    """

    t_ns: int
    x: float
    y: float
    contact_with: str = ""
    count: int = 1
    yaw: float | None = None
    source: str = TRUTH
    speed: float | None = None
    block_s: float = 0.0


class TruthContacts:
    """Each rise of the collision counter; the first sample is the baseline.

    The simulator publishes a sample at every onset, so a rise stands at the pose of the contact.
    """

    def __init__(self) -> None:
        self._before: int | None = None

    def see(self, sample: Truth) -> Contact | None:
        """Take the next sample."""
        before, self._before = self._before, sample.collisions
        if before is None or sample.collisions <= before:
            return None
        return Contact(
            sample.t_ns,
            sample.x,
            sample.y,
            sample.contact_with,
            sample.collisions - before,
            sample.yaw,
            TRUTH,
            sample.impact_speed,
        )


class Whereabouts:
    """Where the robot is by odometry, and how fast it was just now."""

    def __init__(self) -> None:
        self._poses: deque[tuple[int, Pose]] = deque()

    def see(self, t_ns: int, pose: Pose) -> None:
        """Take the next odometry; what is older than needed is forgotten."""
        poses = self._poses
        if poses and t_ns < poses[-1][0]:
            poses.clear()
        poses.append((t_ns, pose))
        while t_ns - poses[0][0] > SAME_TOUCH_S * 1e9:
            poses.popleft()

    def contact(
        self, t_ns: int, source: str, touched: str = "", before: float = BEFORE_S
    ) -> Contact:
        """A contact at the newest pose; its place is not a number while there is none.

        Its speed is the largest of the odometry within ``before``, seconds.
        """
        within = (abs(p.v) for t, p in self._poses if 0 <= t_ns - t <= before * 1e9)
        speed = max(within, default=None)
        if not self._poses:
            return Contact(t_ns, math.nan, math.nan, touched, source=source)
        pose = self._poses[-1][1]
        return Contact(t_ns, pose.x, pose.y, touched, 1, pose.yaw, source, speed)


class BumpContacts:
    """The bumper becoming pressed.

    Zones that are held count once, and reports less than ``BUMP_GAP_S`` apart are one contact,
    whichever zones they name: the rule by which the robot and the simulator count. A bumper that
    has told of being free is held until it does so again, however long that takes; another may
    report only that it is pressed. What is pressed in the first report was touched before, if the
    bag has just begun; later it is a contact.
    """

    def __init__(self) -> None:
        self._pressed_ns: int | None = None
        self._heard = self._held = self._tells_of_release = False

    def see(self, t_ns: int, bumps: Bumps, where: Whereabouts, begin_ns: int = 0) -> Contact | None:
        """Take the next report; the bag begins at log time ``begin_ns``, nanoseconds."""
        first, self._heard = not self._heard, True
        held = first and bumps.log_ns - begin_ns <= BEGINNING_S * 1e9
        if self._held and (self._tells_of_release or not bumps.zones):
            self._pressed_ns = t_ns  # until now
        self._held = bool(bumps.zones)
        if not bumps.zones:
            self._tells_of_release = True
            return None
        before, self._pressed_ns = self._pressed_ns, t_ns
        if held or (before is not None and 0 <= t_ns - before <= BUMP_GAP_S * 1e9):
            return None
        return where.contact(t_ns, BUMP, ", ".join(bumps.zones))


class ClearanceContacts:
    """The clearance ahead falling to 0, which is the LiDAR node's margin before a touch.

    BLIND estimates say nothing. The next contact needs a clearance above ``REARMED_M`` first; what
    stands ahead in the first estimate stood there before.
    """

    def __init__(self) -> None:
        self._armed = False

    def see(self, t_ns: int, judged: Judged, where: Whereabouts) -> Contact | None:
        """Take the next estimate."""
        estimate = judged.estimate
        if estimate.verdict is Verdict.BLIND:
            return None
        touches, armed = estimate.clearance <= 0.0, self._armed
        self._armed = estimate.clearance > REARMED_M or (armed and not touches)
        return where.contact(t_ns, CLEARANCE) if touches and armed else None


def observable(bumps: Iterable[Contact], stalls: Iterable[Contact]) -> tuple[Contact, ...]:
    """Join what a real robot can know into touches, each counted once.

    Args:
        bumps: of the bumper; each counts.
        stalls: counted unless one lies within ``SAME_TOUCH_S`` of a bump.

    Returns:
        The contacts in the order of their times.
    """
    felt = list(bumps)
    unfelt = [
        stall
        for stall in stalls
        if all(abs(stall.t_ns - b.t_ns) > SAME_TOUCH_S * 1e9 for b in felt)
    ]
    return tuple(sorted([*felt, *unfelt], key=lambda contact: contact.t_ns))
