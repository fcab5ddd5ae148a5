"""What the deployment should do about each fault.

Written down in commit 7c012b3 before anything was measured; what was changed after measurements
had begun stands in ``changed`` (for limits in ``reactions.LIMIT_CHANGED``, for how runs are judged
in ``judge.CHANGED``), with its commit and the reason.

A cell is a fault that begins while the robot is in a phase. Its reaction is one of

- stop: the robot comes to rest within the bound, no further motion begins, and the episode ends
  with a sentence that names the cause (but for ``GOES_ON``);
- degrade: it goes on safely with less. With a bound on drives, it may turn in place but not drive
  after it (a disc that turns sweeps its own footprint), it must end as a stop does, and a stop will
  do as well; with a bound on the motion under way, this one ends within it;
- refuse: the goal is refused before any motion;
- ride_through: the motions finish as without the fault, and the goal stays open.

The bounds are those of ``reactions``. Knows no ROS.
"""

from __future__ import annotations

from studies.deploy.changed import CHANGED
from studies.deploy.reactions import LIMIT_CHANGED, Bounded, Expectation, FaultPhase, Reaction

Cell = tuple[Reaction, str, Bounded]

REFUSES: Cell = (Reaction.REFUSE, "", Bounded.NOTHING)
RIDES: Cell = (Reaction.RIDE_THROUGH, "", Bounded.NOTHING)
DEGRADES: Cell = (Reaction.DEGRADE, "", Bounded.NOTHING)


def _stop(limit: str) -> Cell:
    return Reaction.STOP, limit, Bounded.MOTIONS


def _no_drive(limit: str) -> Cell:
    return Reaction.DEGRADE, limit, Bounded.DRIVES


def _cut_short(limit: str) -> Cell:
    return Reaction.DEGRADE, limit, Bounded.UNDER_WAY


def _blind(limit: str, reason: str) -> tuple:
    """A LiDAR that sees nothing, or depth too much: nothing drives, a turn may finish."""
    return _stop(limit), _no_drive(limit), _stop(limit), reason


def _stops(limit: str, reason: str, refused: bool = False) -> tuple:
    return _stop(limit), _stop(limit), REFUSES if refused else _stop(limit), reason


def _rides(reason: str) -> tuple:
    return RIDES, RIDES, RIDES, reason


_RIVAL = "only the publisher that was there at first is believed"

_SCAN = {
    "scan_silent": _blind("stale scan", "the newest scan grows older than a scan may be"),
    "scan_half_rate": _rides("a scan every 0.26 s is still younger than 0.4 s"),
    "scan_burst_loss": (
        _cut_short("stale scan"), DEGRADES, DEGRADES,
        "three scans are lost at first: a gap of 0.52 s outlasts the stale limit, so that no drive "
        "goes on through it; later two or three, and 0.39 s does not",
    ),
    "scan_late_0.2": _rides(
        "0.2 s late and 0.13 s to the next are below 0.4 s from the end of a turn; by its stamp, "
        "0.13 s before, the estimate stays below 0.5 s"
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
    "scan_speckle": (
        DEGRADES, DEGRADES, DEGRADES,
        "a lone near return that the scan before had not is a ghost; two in a row at one place, "
        "2 in 100 of those drawn, are not",
    ),
    "scan_ranges_0": _blind("blind scan", "a scan without ranges is malformed"),
    "scan_ranges_1": _blind("blind scan", "one range is no turn"),
    "scan_ranges_360": _rides("a return a degree is a whole turn"),
    "scan_ranges_1034_inf": _blind("blind scan", "raw samples without a return: the laser is off"),
    "scan_ranges_269_inf": _blind("blind scan", "as many samples at 2 kHz"),
    "scan_ranges_3240": _rides("finer copies of the same returns"),
    "scan_standard": _rides("2 kHz: a quarter of the bins is empty, none of the gaps is wide"),
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
    "estimate_rival": _stops("graph", _RIVAL, refused=True),
}  # fmt: skip

_UNREADABLE = "a picture that cannot be read is no picture"

_IMAGE = {
    "image_silent": _stops("picture", "the newest picture grows older than a picture may be"),
    "image_slow": _rides("a picture every 0.5 s is younger than 1 s; decisions wait for it"),
    "image_slow_1": (
        DEGRADES,
        DEGRADES,
        DEGRADES,
        "a picture is as old as it may be when the next one comes: it rides through, or stands",
    ),
    "image_burst_loss": _rides("0.3 s without a picture are less than 1 s"),
    "image_late_0.5": _rides("pictures of 0.5 s ago are younger than 1 s; decisions wait for one"),
    "image_late_2": _stops("picture", "every picture arrives older than a picture may be"),
    "image_stamp_zero": _stops("picture", "a picture without a time is an old one"),
    "image_stamp_future": _stops("picture", "a stamp ahead of now comes from another clock"),
    "image_stamp_back": _stops("picture", "a stamp of 5 s ago is an old picture"),
    "image_stamp_jumps": _stops("picture", "every picture is from another time"),
    **{
        fault: _stops("picture", "a camera that is off sends nothing, whoever starts it", True)
        for fault in ("camera_start_hangs", "camera_start_fails")
    },
    "image_rival": _stops("graph", _RIVAL, refused=True),
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

_ALONE = ": depth adds nothing, the LiDAR guards alone"

_DEPTH = {
    "depth_silent": _rides("no picture" + _ALONE),
    "depth_late_2": _rides("a picture of 2 s ago is none of now" + _ALONE),
    "depth_stamp_future": _rides("no odometry is of a time ahead of now" + _ALONE),
    "depth_stamp_back": _rides("a stamp of 5 s ago is an old picture" + _ALONE),
    "depth_rival": _rides("two sources of depth may contradict" + _ALONE),
    "depth_frozen": _rides("a sensor's noise never repeats a whole picture" + _ALONE),
    "depth_all_near": _blind(
        "near depth", "what depth shows before the mast counts, whatever the LiDAR says"
    ),
    "depth_all_zero": _rides("a covered lens measures nothing" + _ALONE),
    "depth_rgb8": _rides("colours are no depth" + _ALONE),
    "depth_data_short": _rides(_UNREADABLE + _ALONE),
    "depth_info_other": _rides("a calibration of another size is another camera's" + _ALONE),
}

_DETECTIONS = {
    "detections_silent": _stops("picture", "the newest word of a detector grows too old"),
    "detections_late_2": _stops("picture", "all that it says is older than a picture may be"),
    "detections_stamp_future": _stops("picture", "a stamp ahead of now comes from another clock"),
    "detections_stamp_back": _stops("picture", "a stamp of 5 s ago is an old picture's"),
    "detections_rival": _stops("graph", _RIVAL, refused=True),
    "detections_frozen": _stops("frozen detections", "no detector says the same bit by bit"),
    "detections_other_labels": _stops(
        "picture", "a number that the labels lack may be anything", refused=True
    ),
    "detections_nan": _stops("picture", "a box that is nowhere is no box"),
    "detections_flood": _stops("picture", "no camera shows so many things"),
    "detections_other_size": _stops(
        "picture", "a box outside of the picture is of another picture", refused=True
    ),
}

_ODOM = {
    "odom_silent": _stops("odometry", "the newest odometry grows older than it may be"),
    "odom_late_0.5": _stops("odometry", "all odometry arrives older than it may be"),
    "odom_slow_8": _rides("0.125 s are less than 0.25 s"),
    "odom_slow_3": (
        DEGRADES, DEGRADES, DEGRADES,
        "between two samples odometry grows older than it may be: motions pause, and go on",
    ),
    "odom_stamp_back": _stops("odometry", "a stamp of 5 s ago is old odometry"),
    "odom_drift_ahead": _stops(
        "drift ahead", "until its stamps lie in the future the odometry counts from its arrival"
    ),
    "odom_drift_back": _stops("drift back", "its stamps grow older than odometry may be"),
    "odom_rival": _stops("graph", _RIVAL, refused=True),
    "odom_stamp_future": _stops("odometry", "a stamp ahead of now comes from another clock"),
    "odom_nan": _stops("odometry", "odometry that is no number is left out and ages"),
    "odom_zero_quaternion": _stops("odometry", "no heading: left out, ages"),
    "odom_bad_quaternion": _stops("odometry", "no unit quaternion: left out, ages"),
    "odom_jump": _stops("odometry", "the pose was reset: where the motion ends is unknown"),
    "odom_turned": _stops("odometry", "the heading was reset: where the motion ends is unknown"),
    "odom_frozen": (
        _stop("stall"), _stop("stall"), DEGRADES,
        "no progress is given up after the stall limit; at rest it looks like a stuck base, so "
        "each motion is begun and given up, guarded by the LiDAR",
    ),
    "odom_slip": (
        _cut_short("slip"), _cut_short("slip"), DEGRADES,
        "at rest nothing is wrong; each motion is begun and given up",
    ),
}  # fmt: skip

_BASE_FAULTS = {
    "base_stuck": _stops("stall", "it stands by itself; motions without progress are given up"),
    "base_slip": _stops("stall", "it stands by itself; motions without progress are given up"),
    "base_pushed": (
        _cut_short("push"), _cut_short("push"), DEGRADES,
        "a motion that was not commanded ends the one under way: rest, look again, go on",
    ),
    "base_busy": _stops("stall", "it does not obey; motions without progress are given up"),
    "base_action": _stops(
        "action", "a button has begun an action: nobody can stop it, but no motion is added"
    ),
    "base_frees_itself": (
        _cut_short("freeing"), _cut_short("freeing"), DEGRADES,
        "a reflex ends the motion under way as a push does: rest, look again, go on",
    ),
    "base_slowed": _rides("a MoveAhead at 0.1 m/s takes 2.7 s of its 5 s, and creeps no slower"),
    "e_stop": _stops("base", "no drive power: wheel_status says so", refused=True),
    "docked": (
        _stop("stale scan"), _stop("picture"), REFUSES,
        "on the dock scan and picture stop, and dock_status says so",
    ),
    "bumper_stuck": _blind("bumper", "a pressed bumper forbids driving; a turn may be the way out"),
    "hazards_silent": _rides("no bump sense, as on a robot as it is sold: the LiDAR guards"),
    "hazards_lost_once": _blind(
        "bumper resent", "the only message of a bump is lost on the way, and delivered again"
    ),
    "hazards_rival": _stops("base check", _RIVAL, refused=True),
    "relay_hangs": _stops("base", "without commands the base stops itself; it says nothing more"),
    "wheels_silent": _rides("the last word on the power holds; without it nothing moves"),
    "dock_silent": _rides("the last word on the dock holds; a robot that drives is on none"),
}  # fmt: skip

_COMMAND = {
    "cmd_deaf": _stops("base", "without commands the base stops itself; nobody listens any more"),
    "cmd_type": _stops("base", "without commands the base stops itself; its type has changed"),
    "cmd_rival": _stops("base check", "one node must drive", refused=True),
    "cmd_loss_30": _rides("the next command comes 0.05 s later, the base holds one for 0.5 s"),
    "cmd_late_0.2": _rides("less exact, but the motion is closed on odometry"),
    "cmd_late_0.35": _stops("late 0.35", "beyond the limit of 0.3 s: two motions begin late"),
    **{
        f"cmd_late_{late}": _stops(
            f"late {late}",
            "a base that does not begin is told to stand before much is queued; what comes late "
            "ends the drive",
        )
        for late in ("0.5", "1", "2")
    },
    "cmd_late_10": _stops("late 10", "nothing is done in time: motions without progress end it"),
    "cmd_cut_1": (
        DEGRADES,
        DEGRADES,
        DEGRADES,
        "the base stops by itself; the motion is given up, and the next one goes on",
    ),
    "network_cut_1": _stops("base", "without commands the base stops itself, until it is mended"),
}

_TIME = {
    "clock_stop": _stops("clock", "node time that stands is watched in real time"),
    "clock_ahead": _stops("odometry", "after a leap every input is from another time"),
    "clock_back": _stops("odometry", "after a leap every input is from another time"),
    "tilt_stuck": (
        RIDES, RIDES, _stop("tilt motion"),
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

SIMULATED = {
    **_SCAN, **_IMAGE, **_DEPTH, **_DETECTIONS, **_ODOM, **_BASE_FAULTS, **_COMMAND, **_TIME,
}  # fmt: skip
"""Faults that the mock robot plays, by the names of its table."""

PROCESS_FAULTS = tuple(_PROCESS)
"""Faults of processes and clients, which the measuring program causes itself."""

GOES_ON = {
    "network_cut_1": "it is mended by itself after a second, and the episode goes on",
    "depth_all_near": "a veto ends no episode: the way may be free again, or another one",
    "policy_sigkill": "nobody is left to end the episode",
    "policy_hang": "who hangs says nothing, and goes on when it is mended",
}
"""Faults after which a stop is not followed by the episode's end, and why."""

MAY_RIDE = (
    ("scan_burst_loss", FaultPhase.TURNING),
    ("scan_burst_loss", FaultPhase.WAITING),
    *(
        (fault, phase)
        for fault in ("scan_speckle", "image_slow_1", "odom_slow_3", "cmd_cut_1")
        for phase in FaultPhase
    ),
)
"""Cells in which chance says what a MoveAhead meets: a gap that outlasts the limit or another one,
ghosts at one place or apart."""


def _expectation(fault: str, phase: FaultPhase, cell: Cell, reason: str) -> Expectation:
    reaction, limit, bounded = cell
    changed = "; ".join(filter(None, (CHANGED.get(fault), LIMIT_CHANGED.get(limit))))
    may_ride = (fault, phase) in MAY_RIDE
    return Expectation(
        fault, phase, reaction, limit, bounded, reason, fault in GOES_ON, may_ride, changed
    )


EXPECTATIONS = tuple(
    _expectation(fault, phase, cell, reason)
    for fault, (*cells, reason) in {**SIMULATED, **_PROCESS}.items()
    for phase, cell in zip(FaultPhase, cells, strict=True)
)
"""Every cell."""

NAMES_CAUSE = {
    "scan": "scan|LiDAR|estimate",
    "image": "picture|image",
    "camera": "picture",
    "depth": "epth",
    "detections": "etect|box|class",
    "estimate": "estimate",
    "relay": "dometry|base",
    "odom": "dometry|odom|slip|motions failed|come to rest",
    "base": "motions failed|base|moves",
    "e_stop": "power|stop",
    "docked": "dock|scan|LiDAR|picture",
    "bumper": "bump",
    "hazards": "bump|hazard",
    "wheels": "power|motions failed",
    "dock_silent": "dock|motions failed",
    "cmd_late": "s late what it was told|come late",
    "cmd": "cmd_vel|late|motions failed|moves",
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
