"""What the deployment should do about each fault: written down before anything was measured.

A cell is a fault that begins while the robot is in a phase. Its reaction is one of

- stop: the robot comes to rest within the bound, and no further motion begins until the fault is
  mended or the episode has ended with a sentence that names the cause;
- degrade: it goes on safely with less. With a bound, it may turn in place but not drive after it
  (a disc that turns sweeps its own footprint), and a stop will do as well;
- refuse: the goal is refused before any motion;
- ride_through: the motions finish as without the fault.

The bound of a stop is the detection limit, taken from the nodes' own defaults, one control period,
an allowance for transport, and the time to brake. Knows no ROS.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from cfnav_ros.clock_watch import GRACE_S
from cfnav_ros.limits import EpisodeLimits
from cfnav_ros.mounting import SEEN_THROUGH
from sim_bridge.base import BaseLimits
from sim_bridge.own_motions import BACK_OFF_M, BACK_OFF_SPEED
from sim_bridge.rplidar import SCAN_PERIOD


class Phase(Enum):
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


STOP, DEGRADE = Reaction.STOP, Reaction.DEGRADE
REFUSE, RIDE_THROUGH = Reaction.REFUSE, Reaction.RIDE_THROUGH
DRIVING, TURNING, WAITING = Phase.DRIVING, Phase.TURNING, Phase.WAITING

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

LIMITS_S = {
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
    "mounting": (SEEN_THROUGH + 1) * SCAN_PERIOD,
    "graph": 1.0,
    "clock": GRACE_S + 0.1,
    "base check": 0.5,
    "base": _BASE.command_timeout,
    "bumper": 2 * 0.05 + REFLEX_S,
    "request": 0.1,
}
"""Detection limits, s: ages, stall and tilt from the episode's limits; a scan's age from the LiDAR
node, with the period of its look at silence; a blind scan is told by the second one; a payload is
frozen after a second, told when the next comes under a new stamp; a wrong mounting after as many
scans as the self-check wants; a look at the graph each second; the clock's grace and the period of
its watch; the policy node's look at cmd_vel; the base's own time-out; two reports of the bumper and
the base's reflex; a signal or a request is seen at the executor's next turn."""


@dataclass(frozen=True)
class Expectation:
    """One cell. ``limit`` names what is detected within its time; empty where nothing need be."""

    fault: str
    phase: Phase
    reaction: Reaction
    limit: str
    reason: str

    @property
    def bound_s(self) -> float | None:
        """Seconds from the fault to rest, or from which nothing drives; None without a limit."""
        if not self.limit:
            return None
        ours = 0.0 if self.limit == "base" else CONTROL_S
        return LIMITS_S[self.limit] + ours + TRANSPORT_S + BRAKING_S[self.phase]

    def met_by(self, found: Reaction) -> bool:
        """Whether what was found is what was expected."""
        turning_only = self.reaction is DEGRADE and self.limit
        return found is self.reaction or bool(turning_only and found is STOP)


def _blind(limit: str, reason: str) -> tuple:
    """A LiDAR that sees nothing: nothing drives, a turn may finish."""
    return (STOP, limit), (DEGRADE, limit), (STOP, limit), reason


def _stops(limit: str, reason: str, refused: bool = False) -> tuple:
    waiting = (REFUSE, "") if refused else (STOP, limit)
    return (STOP, limit), (STOP, limit), waiting, reason


def _rides(reason: str) -> tuple:
    return (RIDE_THROUGH, ""), (RIDE_THROUGH, ""), (RIDE_THROUGH, ""), reason


def _degrades(reason: str) -> tuple:
    return (DEGRADE, ""), (DEGRADE, ""), (DEGRADE, ""), reason


_SCAN = {
    "scan_silent": _blind("stale scan", "the newest scan grows older than a scan may be"),
    "scan_half_rate": _rides("a scan every 0.26 s is still younger than 0.4 s"),
    "scan_burst_loss": _degrades("each gap outlasts the stale limit; between gaps it goes on"),
    "scan_late_0.2": _degrades(
        "0.13 s of turning, 0.2 s late and 0.13 s to the next pass 0.4 s ahead of each new scan"
    ),
    "scan_late_0.5": _blind("stale scan", "every scan arrives older than a scan may be"),
    "scan_late_1": _blind("stale scan", "every scan arrives older than a scan may be"),
    "scan_late_5": _blind("stale scan", "every scan arrives older than a scan may be"),
    "scan_stamp_zero": _blind("blind scan", "a scan without a time says nothing about now"),
    "scan_stamp_future": _blind("blind scan", "a stamp ahead of now comes from another clock"),
    "scan_stamp_back": _blind("blind scan", "a stamp of 5 s ago is an old scan"),
    "scan_stamp_repeated": _blind("stale scan", "a repeated stamp is no new scan, the old ages"),
    "scan_frozen": _blind("frozen scan", "a laser's noise never repeats a whole scan"),
    "scan_all_inf": _blind("blind scan", "the laser is off: no return is no free space"),
    "scan_all_nan": _blind("blind scan", "no number is no free space"),
    "scan_all_zero": _blind("blind scan", "zero is the driver's nothing"),
    "scan_all_near": _blind("blind scan", "returns inside the robot all around are no sight"),
    "scan_sector_30": _blind("blind scan", "30 degrees ahead hide what is as wide as a step needs"),
    "scan_sector_90": _blind("blind scan", "the way ahead is unknown"),
    "scan_sector_180": _blind("blind scan", "the way ahead is unknown"),
    "scan_speckle": _rides("a lone near return that the scan before had not is a ghost"),
    "scan_ranges_0": _blind("blind scan", "a scan without ranges is malformed"),
    "scan_ranges_1": _blind("blind scan", "one range is no turn"),
    "scan_ranges_360": _rides("360 returns without copies are a whole turn"),
    "scan_ranges_1034_inf": _blind("blind scan", "raw samples without a return: the laser is off"),
    "scan_ranges_3240": _rides("finer copies of the same returns"),
    "scan_increment_zero": _blind("blind scan", "all beams in one direction are malformed"),
    "scan_increment_negative": _blind("blind scan", "increment and end angle contradict"),
    "scan_increment_nan": _blind("blind scan", "angles that are no number are malformed"),
    "scan_increment_wrong": _blind("blind scan", "increment, count and end angle contradict"),
    "scan_limits_swapped": _blind("blind scan", "range_min above range_max is no interval"),
    "scan_short": _blind("blind scan", "fewer ranges than the angles declare"),
    "scan_wrong_frame": _blind("blind scan", "another frame has another mounting"),
    "scan_turned_90": _blind("mounting", "the robot's own posts are not where they must be"),
    "scan_mirrored": _blind("mounting", "mirrored about the laser's axis, front and rear swap"),
    "scan_rival": _blind("graph", "two sources of scans may contradict"),
}  # fmt: skip

_UNREADABLE = "a picture that cannot be read is no picture"

_IMAGE = {
    "image_silent": _stops("picture", "the newest picture grows older than a picture may be"),
    "image_slow": _rides("a picture every 0.5 s is younger than 1 s; decisions wait for it"),
    "image_late_0.5": _rides("pictures of 0.5 s ago are younger than 1 s; decisions wait for one"),
    "image_late_2": _stops("picture", "every picture arrives older than a picture may be"),
    "image_stamp_zero": _stops("picture", "a picture without a time is an old one"),
    "image_stamp_future": _stops("picture", "a stamp ahead of now comes from another clock"),
    "image_frozen": _stops("frozen picture", "a sensor's noise never repeats a whole picture"),
    "image_black": _stops("picture", "a picture without contrast shows nothing", refused=True),
    "image_white": _stops("picture", "a picture without contrast shows nothing", refused=True),
    "image_mono8": _rides("grey is a readable encoding"),
    "image_bgra8": _rides("a readable encoding"),
    "image_rgb8": _rides("a readable encoding, told by its name"),
    "image_yuv422": _stops("picture", _UNREADABLE, refused=True),
    "image_16uc1": _stops("picture", _UNREADABLE, refused=True),
    "image_padded": _rides("rows are read by their step"),
    "image_step_short": _stops("picture", _UNREADABLE, refused=True),
    "image_data_short": _stops("picture", _UNREADABLE, refused=True),
    "image_empty": _stops("picture", _UNREADABLE, refused=True),
    "image_huge": _stops("picture", "no camera of this robot takes it", refused=True),
}

_ODOM = {
    "odom_silent": _stops("odometry", "the newest odometry grows older than it may be"),
    "odom_late_0.5": _stops("odometry", "all odometry arrives older than it may be"),
    "odom_stamp_future": _stops("odometry", "a stamp ahead of now comes from another clock"),
    "odom_nan": _stops("odometry", "odometry that is no number is left out and ages"),
    "odom_zero_quaternion": _stops("odometry", "no heading: left out, ages"),
    "odom_bad_quaternion": _stops("odometry", "no unit quaternion: left out, ages"),
    "odom_jump": _stops("odometry", "the pose was reset: where the motion ends is unknown"),
    "odom_turned": _stops("odometry", "the heading was reset: where the motion ends is unknown"),
    "odom_frozen": (
        (STOP, "stall"), (STOP, "stall"), (DEGRADE, ""),
        "no progress is given up after the stall limit; at rest it looks like a stuck base, so "
        "each motion is begun and given up, guarded by the LiDAR",
    ),
    "odom_slip": _degrades("at rest nothing is wrong; each motion is begun and given up"),
}  # fmt: skip

_BASE_FAULTS = {
    "base_stuck": _stops("stall", "it stands by itself; motions without progress are given up"),
    "base_slip": _stops("stall", "it stands by itself; motions without progress are given up"),
    "base_pushed": _degrades("a motion that was not commanded: rest, look again, go on"),
    "base_busy": _stops("stall", "it does not obey; motions without progress are given up"),
    "e_stop": _stops("base", "no drive power: wheel_status says so", refused=True),
    "docked": (
        (STOP, "stale scan"), (STOP, "picture"), (REFUSE, ""),
        "on the dock scan and picture stop, and dock_status says so",
    ),
    "bumper_stuck": _blind("bumper", "a pressed bumper forbids driving; a turn may be the way out"),
    "hazards_silent": _rides("no bump sense, as on a robot as it is sold: the LiDAR guards"),
    "wheels_silent": _rides("the last word on the power holds; without it nothing moves"),
    "dock_silent": _rides("the last word on the dock holds; a robot that drives is on none"),
}  # fmt: skip

_COMMAND = {
    "cmd_deaf": _stops("base", "without commands the base stops itself; nobody listens any more"),
    "cmd_type": _stops("base", "without commands the base stops itself; its type has changed"),
    "cmd_rival": _stops("base check", "one node must drive", refused=True),
    "cmd_loss_30": _rides("the next command comes 0.05 s later, the base holds one for 0.5 s"),
    "cmd_late_0.2": _rides("less exact, but the motion is closed on odometry"),
    "network_cut_1": _stops("base", "without commands the base stops itself, until it is mended"),
}

_TIME = {
    "clock_stop": _stops("clock", "node time that stands is watched in real time"),
    "clock_ahead": _stops("odometry", "after a leap every input is from another time"),
    "clock_back": _stops("odometry", "after a leap every input is from another time"),
    "tilt_stuck": (
        (RIDE_THROUGH, ""), (RIDE_THROUGH, ""), (STOP, "tilt motion"),
        "motions of the base need no tilt; a tilt that is not reached ends the episode",
    ),
    "joints_silent": _stops("tilt", "where the camera looks is not known any more"),
}  # fmt: skip

_PROCESS = {
    "policy_sigkill": _stops("base", "nobody commands: the base stops itself"),
    "policy_sigint": _stops("request", "the node's last commands are zero"),
    "policy_sigterm": _stops("request", "the node's last commands are zero"),
    "policy_hang": _stops("base", "nobody commands: the base stops itself"),
    "lidar_sigkill": _stops("estimate", "the newest estimate grows older than it may be"),
    "lidar_hang": _stops("estimate", "the newest estimate grows older than it may be"),
    "goal_cancel": _stops("request", "a canceled goal ends in zero velocity"),
    "goal_newer": _stops("request", "a newer goal ends the older one in zero velocity"),
    "client_gone": _rides("a goal outlives its client, as in every ROS 2 action server"),
}

SIMULATED = {**_SCAN, **_IMAGE, **_ODOM, **_BASE_FAULTS, **_COMMAND, **_TIME}
"""Faults that the mock robot plays, by the names of its table."""

PROCESS_FAULTS = tuple(_PROCESS)
"""Faults of processes and clients, which the measuring program causes itself."""

EXPECTATIONS = tuple(
    Expectation(fault, phase, *cell, reason)
    for fault, (*cells, reason) in {**SIMULATED, **_PROCESS}.items()
    for phase, cell in zip((DRIVING, TURNING, WAITING), cells, strict=True)
)
"""Every cell."""

NAMES_CAUSE = {
    "scan": "scan|LiDAR|estimate",
    "image": "picture",
    "odom": "dometry|slip|motions failed|come to rest",
    "base": "motions failed|base|moves",
    "e_stop": "power|stop",
    "docked": "dock|scan|LiDAR|picture",
    "bumper": "bump",
    "hazards": "bump",
    "wheels": "power|motions failed",
    "dock_silent": "dock|motions failed",
    "cmd": "cmd_vel",
    "network": "",
    "clock": "time|clock|old|future|jumped",
    "tilt": "camera",
    "joints": "tilt",
    "policy": "stopped",
    "lidar": "estimate|LiDAR|scan",
    "goal": "cancel|newer",
    "client": "",
}
"""What the sentence that ends an episode must speak of, by how a fault's name begins (a regular
expression)."""
