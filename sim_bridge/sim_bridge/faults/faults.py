"""What can go wrong with the mock, by name: ``FAULTS`` is the table.

A fault either alters messages under way, or breaks a part that looks for its name
(``Simulator.faults``, the mock's clock and command topics). Knows no ROS: messages are taken as
they come. Time is simulated seconds, and an argument.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from sim_bridge.faults import detection_faults, picture_faults, scan_faults

IMAGE, CAMERA_INFO = "image", "camera_info"
DEPTH, DEPTH_INFO, DETECTIONS = "depth", "depth_info", "detections"
SCAN, ODOM, TF, JOINTS = "scan", "odom", "tf", "joint_states"
HAZARDS, WHEELS, DOCK = "hazards", "wheel_status", "dock_status"
COMMANDS = "cmd_vel"
"""Commands of either type on their way in. Topics go by their roles in the table of topics."""

EVERYTHING = "*"
RELAYED = (ODOM, TF, HAZARDS, WHEELS, DOCK, COMMANDS)
"""What passes through the relay between the base and everybody else."""

FUTURE_S, PAST_S = 5.0, -5.0
JUMPS_S = 4.0
DRIFT = 0.5
"""s that the base's clock gains or loses in a second. A quartz takes hours for as much; what counts
is the offset that is reached, and nobody watches a drive for hours."""
RESENT_S = 3.0
"""s until what was lost on the way is sent again, by the heartbeat of Fast DDS, to those who asked
for reliable delivery; nobody else ever hears of it."""
SLOW_PICTURES_HZ = 2.0
LOST_COMMANDS = 0.3
LATE_COMMANDS_S = (0.2, 0.35, 0.5, 1.0, 2.0, 10.0)

Alter = Callable[[Any, float], Any]
"""Message and time of its making -> the message to send, None for none."""


@dataclass(frozen=True)
class Fault:
    """One row of the table.

    Attributes:
        topics: whose messages it alters or delays; none where it breaks a part.
        begin: makes the alteration anew each time the fault begins, given noise to draw from.
        delay: s by which messages come later.
        lasts: s after which it is over by itself; inf for never.
    """

    topics: tuple[str, ...] = ()
    begin: Callable[[np.random.Generator], Alter] | None = None
    delay: float = 0.0
    lasts: float = math.inf


def silent(_: np.random.Generator) -> Alter:
    """Nothing is sent."""
    return lambda message, t: None


def every(period: float) -> Callable[[np.random.Generator], Alter]:
    """At most one message in a period of s; the first is sent."""

    def begin(_: np.random.Generator) -> Alter:
        sent: dict[type, float] = {}

        def alter(message: Any, t: float) -> Any:
            if t < sent.get(type(message), -math.inf) + period - 1e-9:
                return None
            sent[type(message)] = t
            return message

        return alter

    return begin


def every_second(_: np.random.Generator) -> Alter:
    """One message, then none, in turn."""
    count = [0]

    def alter(message: Any, t: float) -> Any:
        count[0] += 1
        return message if count[0] % 2 else None

    return alter


def bursts(_: np.random.Generator) -> Alter:
    """What is made in the first 0.3 s of every second is lost."""
    began: list[float] = []

    def alter(message: Any, t: float) -> Any:
        began[:] = began or [t]
        return None if (t - began[0]) % 1.0 < 0.3 - 1e-9 else message

    return alter


def lossy(share: float) -> Callable[[np.random.Generator], Alter]:
    """A share of all messages is lost."""
    return lambda rng: lambda message, t: None if rng.random() < share else message


def changed(change: Callable[[Any], None]) -> Callable[[np.random.Generator], Alter]:
    """Each message is changed in place, the same way."""

    def alter(message: Any, t: float) -> Any:
        change(message)
        return message

    return lambda _: alter


def shifted(seconds: float) -> Callable[[np.random.Generator], Alter]:
    """Stamps off by so many s; none lies before zero, which a stamp cannot say."""

    def change(message: Any) -> None:
        stamp = message.header.stamp
        ns = max(0, stamp.sec * 10**9 + stamp.nanosec + round(seconds * 1e9))
        stamp.sec, stamp.nanosec = divmod(ns, 10**9)

    return changed(change)


def jumping(seconds: float) -> Callable[[np.random.Generator], Alter]:
    """Stamps that are ahead and behind by so many s, in turn."""

    def begin(rng: np.random.Generator) -> Alter:
        ahead, behind = shifted(seconds)(rng), shifted(-seconds)(rng)
        count = [0]

        def alter(message: Any, t: float) -> Any:
            count[0] += 1
            return (ahead if count[0] % 2 else behind)(message, t)

        return alter

    return begin


def drifting(rate: float) -> Callable[[np.random.Generator], Alter]:
    """Stamps of a clock that gains so many s in a second from now on."""

    def begin(rng: np.random.Generator) -> Alter:
        began: list[float] = []

        def alter(message: Any, t: float) -> Any:
            began[:] = began or [t]
            return shifted(rate * (t - began[0]))(rng)(message, t)

        return alter

    return begin


def unstamped(message: Any) -> None:
    """The stamp is zero."""
    message.header.stamp.sec = message.header.stamp.nanosec = 0


def frozen(*kept: str) -> Callable[[np.random.Generator], Alter]:
    """Fields keep the value that they had when the fault began; the rest goes on."""

    def begin(_: np.random.Generator) -> Alter:
        first: dict[str, Any] = {}

        def alter(message: Any, t: float) -> Any:
            for name in kept:
                holder, _, field = name.rpartition(".")
                owner = getattr(message, holder) if holder else message
                value = first.setdefault(name, deepcopy(getattr(owner, field)))
                # A copy, as another fault may change the message in place.
                setattr(owner, field, deepcopy(value))
            return message

        return alter

    return begin


def speckled(rng: np.random.Generator) -> Alter:
    """See ``scan_faults.speckle``."""
    return changed(scan_faults.speckle(rng))(rng)


def near(rng: np.random.Generator) -> Alter:
    """See ``picture_faults.all_near``."""
    return changed(picture_faults.all_near(rng))(rng)


def _half_size(calibration: Any) -> None:
    calibration.width, calibration.height = calibration.width // 2, calibration.height // 2


def _position_nan(odometry: Any) -> None:
    odometry.pose.pose.position.x = math.nan


def _scaled_quaternion(factor: float, odometry: Any) -> None:
    q = odometry.pose.pose.orientation
    q.x, q.y, q.z, q.w = (factor * value for value in (q.x, q.y, q.z, q.w))


def _of(topics: tuple[str, ...], shapes: dict[str, Callable[[Any], None]]) -> dict[str, Fault]:
    return {name: Fault(topics, changed(shape)) for name, shape in shapes.items()}


_CAMERA, _STEREO, _COUNTED = (IMAGE, CAMERA_INFO), (DEPTH, DEPTH_INFO), (ODOM, TF)
_SAID = (DETECTIONS,)

_SCAN = {
    "scan_silent": Fault((SCAN,), silent),
    "scan_half_rate": Fault((SCAN,), every_second),
    "scan_burst_loss": Fault((SCAN,), bursts),
    **{f"scan_late_{s:g}": Fault((SCAN,), delay=s) for s in (0.2, 0.5, 1.0, 5.0)},
    "scan_stamp_zero": Fault((SCAN,), changed(unstamped)),
    "scan_stamp_future": Fault((SCAN,), shifted(FUTURE_S)),
    "scan_stamp_back": Fault((SCAN,), shifted(PAST_S)),
    "scan_stamp_repeated": Fault((SCAN,), frozen("header.stamp")),
    "scan_frozen": Fault((SCAN,), frozen("ranges", "intensities")),
    "scan_speckle": Fault((SCAN,), speckled),
    **_of((SCAN,), scan_faults.SHAPES),
    "scan_standard": Fault(),
    "scan_rival": Fault(),
    "estimate_rival": Fault(),
}

_PICTURE = {
    "image_silent": Fault(_CAMERA, silent),
    "image_slow": Fault(_CAMERA, every(1.0 / SLOW_PICTURES_HZ)),
    "image_slow_1": Fault(_CAMERA, every(1.0)),
    "image_burst_loss": Fault(_CAMERA, bursts),
    "image_late_0.5": Fault(_CAMERA, delay=0.5),
    "image_late_2": Fault(_CAMERA, delay=2.0),
    "image_stamp_zero": Fault((IMAGE,), changed(unstamped)),
    "image_stamp_future": Fault((IMAGE,), shifted(FUTURE_S)),
    "image_stamp_back": Fault((IMAGE,), shifted(PAST_S)),
    "image_stamp_jumps": Fault((IMAGE,), jumping(JUMPS_S)),
    "image_rival": Fault(),
    "image_frozen": Fault((IMAGE,), frozen("data")),
    **_of((IMAGE,), picture_faults.SHAPES),
}

_PICTURE |= {
    name: Fault((*_CAMERA, *_STEREO), silent)
    for name in ("camera_start_hangs", "camera_start_fails")
}
"""The camera is off, and nobody answers who asks to start it, or says that it cannot be."""

_DEPTH = {
    "depth_silent": Fault(_STEREO, silent),
    "depth_late_2": Fault(_STEREO, delay=2.0),
    "depth_stamp_future": Fault((DEPTH,), shifted(FUTURE_S)),
    "depth_stamp_back": Fault((DEPTH,), shifted(PAST_S)),
    "depth_rival": Fault(),
    "depth_frozen": Fault((DEPTH,), frozen("data")),
    "depth_all_near": Fault((DEPTH,), near),
    **_of((DEPTH,), picture_faults.DEPTH_SHAPES),
    "depth_info_other": Fault((DEPTH_INFO,), changed(_half_size)),
}
"""Nothing happens to a robot without a depth camera."""

_DETECTIONS = {
    "detections_silent": Fault(_SAID, silent),
    "detections_late_2": Fault(_SAID, delay=2.0),
    "detections_stamp_future": Fault(_SAID, shifted(FUTURE_S)),
    "detections_stamp_back": Fault(_SAID, shifted(PAST_S)),
    "detections_rival": Fault(),
    "detections_frozen": Fault(_SAID, frozen("detections")),
    **_of(_SAID, detection_faults.SHAPES),
}
"""Nothing happens to a robot without a detector."""

_ODOMETRY = {
    "odom_silent": Fault(_COUNTED, silent),
    "odom_late_0.5": Fault(_COUNTED, delay=0.5),
    "odom_slow_8": Fault(_COUNTED, every(1.0 / 8.0)),
    "odom_slow_3": Fault(_COUNTED, every(1.0 / 3.0)),
    "odom_stamp_future": Fault((ODOM,), shifted(FUTURE_S)),
    "odom_stamp_back": Fault((ODOM,), shifted(PAST_S)),
    "odom_drift_ahead": Fault((ODOM,), drifting(DRIFT)),
    "odom_drift_back": Fault((ODOM,), drifting(-DRIFT)),
    "odom_rival": Fault(),
    "odom_nan": Fault((ODOM,), changed(_position_nan)),
    "odom_zero_quaternion": Fault((ODOM,), changed(partial(_scaled_quaternion, 0.0))),
    "odom_bad_quaternion": Fault((ODOM,), changed(partial(_scaled_quaternion, 2.0))),
    "odom_jump": Fault(lasts=0.1),
    "odom_turned": Fault(lasts=0.1),
    "odom_frozen": Fault((ODOM,), frozen("pose", "twist")),
    "odom_slip": Fault((ODOM,), frozen("pose")),
}

_BASE = {
    "base_stuck": Fault(),
    "base_slip": Fault(),
    "base_pushed": Fault(lasts=0.5),
    "base_busy": Fault(),
    "base_action": Fault(lasts=10.0),
    "base_frees_itself": Fault(lasts=3.0),
    "base_slowed": Fault(),
    "e_stop": Fault(),
    "docked": Fault(),
    "bumper_stuck": Fault(),
    "tilt_stuck": Fault(),
    "joints_silent": Fault((JOINTS,), silent),
    "hazards_silent": Fault((HAZARDS,), silent),
    "hazards_lost_once": Fault((HAZARDS,), delay=RESENT_S),
    "hazards_rival": Fault(),
    "relay_hangs": Fault(RELAYED, silent),
    "wheels_silent": Fault((WHEELS,), silent),
    "dock_silent": Fault((DOCK,), silent),
}

_COMMAND = {
    "cmd_deaf": Fault(),
    "cmd_type": Fault(),
    "cmd_rival": Fault(),
    "cmd_loss_30": Fault((COMMANDS,), lossy(LOST_COMMANDS)),
    **{f"cmd_late_{s:g}": Fault((COMMANDS,), delay=s) for s in LATE_COMMANDS_S},
    "cmd_cut_1": Fault((COMMANDS,), silent, lasts=1.0),
    "network_cut_1": Fault((EVERYTHING,), silent, lasts=1.0),
}

_CLOCK = {"clock_stop": Fault(), "clock_ahead": Fault(), "clock_back": Fault()}

FAULTS: dict[str, Fault] = {
    **_SCAN, **_PICTURE, **_DEPTH, **_DETECTIONS, **_ODOMETRY, **_BASE, **_COMMAND, **_CLOCK,
}  # fmt: skip
"""Every fault by name; those that hold alter a message in this order."""
