"""How a robot may react to a fault, within which time, and what a run of a cell is judged by.

The bound of a stop is the detection limit, taken from the nodes' own defaults, one control period,
an allowance for transport, and the time to brake. Knows no ROS.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal

from cfnav_ros.drive.clock_watch import GRACE_S
from cfnav_ros.drive.disturbance import SLIP_WINDOW_S
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.lidar.mounting import SEEN_THROUGH
from cfnav_ros.lidar.scan_watch import GRAPH_S
from cfnav_ros.robot.stamps import FUTURE_S
from sim_bridge.faults.faults import DRIFT, FAULTS, RESENT_S
from sim_bridge.robot.base import BaseLimits
from sim_bridge.robot.noise import NoiseLevels
from sim_bridge.robot.own_motions import BACK_OFF_M, BACK_OFF_SPEED
from sim_bridge.robot.rplidar import SCAN_PERIOD


class FaultPhase(Enum):
    """What the robot does when the fault begins."""

    DRIVING = "driving"
    """A MoveAhead, faster than 0.1 m/s; more of them follow."""

    TURNING = "turning"
    """A RotateLeft, faster than 0.3 rad/s; MoveAheads follow."""

    WAITING = "waiting"
    """The camera tilts between motions, MoveAheads follow; for a refusal, before the goal comes."""


class Reaction(Enum):
    """What the deployment does about a fault."""

    STOP = "stop"
    DEGRADE = "degrade"
    REFUSE = "refuse"
    RIDE_THROUGH = "ride_through"


class Bounded(Enum):
    """What must be over within the bound."""

    NOTHING = "nothing"
    MOTIONS = "every motion"
    DRIVES = "every drive"
    UNDER_WAY = "the motion under way"


DRIVING, TURNING, WAITING = FaultPhase

CONTROL_S = 0.05
"""One period of the policy node's velocities, s."""

TRANSPORT_S = 0.05
"""Allowance for a message's way and a process's turn on a shared machine, s."""

_EPISODE, _BASE = EpisodeLimits(), BaseLimits()
_TOP_WHEEL_SPEED = {
    DRIVING: _EPISODE.motion.v_max,
    TURNING: _EPISODE.motion.w_max * _BASE.wheel_separation / 2,
}
BRAKING_S = {phase: v / _BASE.wheel_acceleration for phase, v in _TOP_WHEEL_SPEED.items()}
BRAKING_S[WAITING] = BRAKING_S[DRIVING]  # a MoveAhead may begin before the limit has passed
"""From the executor's top speed to rest, s: 0.222 driving, 0.129 turning."""

REFLEX_S = BACK_OFF_M[1] / -BACK_OFF_SPEED + 2 * -BACK_OFF_SPEED / _BASE.wheel_acceleration
"""How long the base backs off by itself from what it has bumped into, s; it heeds nobody then."""

TOLD_S = 5.0
"""For how long after a fault a base whose commands come late is told to move, at most, s: the rest
of a MoveAhead and the beginnings of two more, or three motions without progress, and the looks
between them."""

TILTS_S = 4.0
"""Before a base that waits is told to move, s: the camera tilts three times."""

LIMITS_S = {
    **{
        name.removeprefix("cmd_").replace("_", " "): TOLD_S + fault.delay
        for name, fault in FAULTS.items()
        if name.startswith("cmd_late_")
    },
    "odometry": _EPISODE.ages.odometry,
    "estimate": _EPISODE.ages.estimate,
    "picture": _EPISODE.ages.frame,
    "tilt": _EPISODE.ages.tilt,
    "stall": _EPISODE.motion.stall_time,
    "tilt motion": _EPISODE.tilt_timeout,
    "stale scan": 0.4 + 0.1,
    "blind scan": 2 * SCAN_PERIOD,
    "frozen scan": 1.0 + SCAN_PERIOD,
    "frozen picture": 1.0 + 1 / 15,
    "frozen detections": 1.0 + 1 / 7.5 + 0.1,
    "near depth": 1 / 10 + NoiseLevels().depth_latency + 3 * SCAN_PERIOD,
    "mounting": (SEEN_THROUGH + 1) * SCAN_PERIOD,
    "slip": SLIP_WINDOW_S + 0.05,
    "push": FAULTS["base_pushed"].lasts + 0.05,
    "action": FAULTS["base_action"].lasts + 0.05,
    "freeing": FAULTS["base_frees_itself"].lasts + 0.05,
    "drift back": 0.05 + _EPISODE.ages.odometry / DRIFT,
    "drift ahead": 0.05 + (FUTURE_S + 0.05 + NoiseLevels().odometry_latency) / DRIFT,
    "graph": GRAPH_S,
    "clock": GRACE_S + 0.1,
    "base check": 0.5,
    "base": _BASE.command_timeout,
    "bumper": 2 * 0.05 + REFLEX_S,
    "bumper resent": 0.05 + RESENT_S,
    "request": 0.1,
}
"""Detection limits, s: ages, stall and tilt from the episode's limits; a scan's age from the LiDAR
node, with the period of its look at silence; a blind scan is told by the second one; a payload is
frozen after a second, told when the next comes under a new stamp; a clock that drifts from the next
odometry on, when it is behind by odometry's age, or ahead by what comes from another clock and the
age of the newest odometry; what depth shows, from the next picture and its latency on, when two
that were looked at in a row have shown it at one place: one is looked at with each scan, and of
what moves with the robot those that lie 0.2 s apart do not; a wrong mounting after as many scans as
the self-check wants; a slip is told when all of its window shows it, and what the base does by
itself when it is over, each by the next odometry; the LiDAR node's look at the graph; the clock's
grace and the period of its watch; the policy node's look at cmd_vel; the base's own time-out; two
reports of the bumper and the base's reflex, or one that the middleware sends again; a signal or a
request is seen at the executor's next turn."""


LIMIT_CHANGED = {
    "stale scan": "5be2727: limit was 0.4 s, without the period of the look at silence",
    "frozen scan": "3ee5639: limit was 1.0 s, without the period of scans",
    "frozen picture": "3ee5639: limit was 1.0 s, without the period of pictures",
    "mounting": "6e16636: limit was 3.0 s, now the scans that the self-check wants",
    "bumper": "180bd83: limit was 0.1 s, without the base's own reflex",
    "graph": "ce556f7: limit was 1.0 s, the LiDAR node looks more often",
}
"""Limits that were changed after measurements had begun: commit and reason."""


Part = Literal["", "depth", "detector"]
"""A camera's part that not every robot has."""

PARTS: dict[str, Part] = {"depth": "depth", "detections": "detector"}
"""By how the names of its faults begin."""


@dataclass(frozen=True)
class Expectation:
    """One cell. ``limit`` names what is detected within its time; empty where nothing need be."""

    fault: str
    phase: FaultPhase
    reaction: Reaction
    limit: str
    bounded: Bounded
    reason: str
    goes_on: bool = False
    """After a stop the episode need not end."""
    may_ride: bool = False
    """To ride through is as good as to degrade: it depends on when the fault meets the motion."""
    changed: str = ""
    """What was changed after measurements had begun: commits and reasons."""

    @property
    def bound_s(self) -> float | None:
        """Seconds from the fault to the end of what is bounded; None without a limit."""
        if not self.limit:
            return None
        return self._after(LIMITS_S[self.limit])

    @property
    def end_s(self) -> float | None:
        """Seconds from the fault to the episode's end; None where only the motions are bounded.

        What comes later than a second is not waited for: three motions without progress end it.
        """
        if not self.limit.startswith("late "):
            return None
        soonest = min(LIMITS_S[self.limit], TOLD_S + 1.0)
        return self._after(soonest) + _EPISODE.stop_time + TRANSPORT_S

    def _after(self, detected_s: float) -> float:
        """When the base is at rest if a fault is detected after so many seconds."""
        ours = 0.0 if self.limit == "base" else CONTROL_S
        tilts = self.limit.startswith("late ") and self.phase is FaultPhase.WAITING
        before = TILTS_S if tilts else 0.0
        return before + detected_s + ours + TRANSPORT_S + BRAKING_S[self.phase]

    @property
    def ends(self) -> bool:
        """Whether the episode must end with a sentence that names the cause."""
        stops = self.bounded in (Bounded.MOTIONS, Bounded.DRIVES)
        return stops and not self.goes_on

    @property
    def part(self) -> Part:
        """What the robot has besides: all cells of its faults need it, no others do."""
        return PARTS.get(self.fault.partition("_")[0], "")

    @property
    def before_wall(self) -> bool:
        """Whether half of the runs are made before a wall, which who drives on blind would touch.

        Faults of the scan, the estimate and of processes, and late commands, while driving. Not
        where two whole motions must finish, or may, or where two must begin late.
        """
        first = self.fault.partition("_")[0]
        source = first in ("scan", "estimate", "lidar", "policy", "goal") or "_late_" in self.fault
        rides = self.reaction is Reaction.RIDE_THROUGH or self.may_ride
        two = rides or self.limit == "late 0.35"
        return source and self.phase is FaultPhase.DRIVING and not two

    @property
    def terms(self) -> dict[str, Any]:
        """What a run is judged by; a stored run holds while these are today's."""
        return {
            "reaction": self.reaction.value,
            "limit": self.limit,
            "bounded": self.bounded.value,
            "bound_s": None if self.bound_s is None else round(self.bound_s, 3),
            "ends": self.ends,
            "may_ride": self.may_ride,
            **({"end_s": round(self.end_s, 3)} if self.end_s is not None else {}),
        }

    def met_by(self, found: Reaction) -> bool:
        """Whether what was found is what was expected."""
        degrades = self.reaction is Reaction.DEGRADE
        if found is Reaction.STOP:
            # where the way ahead is closed a robot that could go on stands, too
            stop_will_do = degrades and (bool(self.limit) or self.before_wall)
            return self.reaction is Reaction.STOP or stop_will_do
        return found is self.reaction or (self.may_ride and found is Reaction.RIDE_THROUGH)
