"""What an episode knows of the robot at one moment, and when that is too old to act on.

Pure. Stamps are node time; those that go into records are integer nanoseconds, ages are seconds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from cfnav_core.robot.settings import setting
from cfnav_ros.drive.motion import Odometry
from cfnav_ros.drive.preflight import BaseCheck
from cfnav_ros.lidar.estimate import Estimate, blind
from cfnav_ros.robot.stamps import FUTURE_S, NEVER, NEVER_NS, OTHER_TIME_S, seconds

PICTURE, DETECTIONS = "picture", "message of the detector"
"""What a policy looks at: pictures, or what a detector says of them."""


def _no_picture(_: int = 1) -> Any:
    raise ValueError("No picture has arrived.")


@dataclass(frozen=True)
class CameraFrame:
    """A picture; ``decode`` gives uint8 [H, W, 3] RGB or raises ValueError with one sentence.

    For a policy that reads sightings it is what a detector said of one, and ``decode`` gives those.
    ``decode(n)`` gives every n-th row and column only. ``height`` and ``width`` are in pixels;
    ``data`` are its bytes, for comparison only; ``fault`` is one sentence when it is known to be no
    picture without decoding it, ``waiting`` when that may pass.
    """

    stamp_ns: int = NEVER_NS
    decode: Callable[..., Any] = _no_picture
    height: int = 0
    width: int = 0
    data: Any = None
    fault: str = ""
    waiting: str = ""


@dataclass(frozen=True)
class PictureCheck:
    """What is wrong with the newest picture: ``fault`` is for good, ``waiting`` may pass."""

    waiting: str = ""
    fault: str = ""


@dataclass(frozen=True)
class StampedEstimate:
    """A collision estimate and the stamp of the scan it came from."""

    stamp_ns: int = NEVER_NS
    estimate: Estimate = field(default_factory=lambda: blind("No estimate has arrived."))


@dataclass(frozen=True)
class Tilt:
    """Measured camera tilt, radians, up positive; stamp in seconds."""

    stamp: float = NEVER
    angle: float = math.nan


@dataclass(frozen=True)
class SensorInputs:
    """The newest message of each kind; stamped ``NEVER`` until the first.

    Attributes:
        base: who listens on cmd_vel.
        frame: newest picture; ``picture`` is what is wrong with it.
        view: what the frame is called, ``PICTURE`` or ``DETECTIONS``.
        estimate: newest collision estimate.
        odometry: newest pose and velocity.
        tilt: newest tilt of the camera.
        bumper: the newest report says that it is pressed. That holds until another one comes: a
            Create 3 reports hazards when they change (firmware H.2.5 and later), older ones at
            20 Hz.
        bumped_at: stamp of the newest report of a bump, seconds: it may be over already.
        docked: the base says that it sits on its dock.
        powered: the base says that its wheels have power; so do bases that say nothing.
        arrived: node time at which the newest message of each field came, seconds.
        battery: charge that is left, 0 to 1; nan while the base does not say.
        rival: one sentence when an input has another publisher than the one that it should have.
        notes: why an input may be missing or old, by field; part of a sentence.
    """

    base: BaseCheck = BaseCheck(waiting="Nobody has looked for a robot yet.")  # noqa: RUF009
    frame: CameraFrame = field(default_factory=CameraFrame)
    picture: PictureCheck = field(default_factory=PictureCheck)
    view: str = PICTURE
    estimate: StampedEstimate = field(default_factory=StampedEstimate)
    odometry: Odometry = field(default_factory=lambda: Odometry(NEVER, 0.0, 0.0, 0.0))
    tilt: Tilt = field(default_factory=Tilt)
    bumper: bool = False
    bumped_at: float = NEVER
    docked: bool = False
    powered: bool = True
    battery: float = math.nan
    rival: str = ""
    arrived: Mapping[str, float] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)

    @property
    def stamps(self) -> dict[str, float]:
        """Stamps of the inputs that have an age, seconds."""
        return {
            "frame": seconds(self.frame.stamp_ns),
            "odometry": self.odometry.stamp,
            "estimate": seconds(self.estimate.stamp_ns),
            "tilt": self.tilt.stamp,
        }

    def made(self, name: str) -> float:
        """When an input that has an age was made, seconds: it cannot be later than it came."""
        stamp = self.stamps[name]
        return min(stamp, self.arrived.get(name, stamp))


@dataclass(frozen=True)
class AgeLimits:
    """Oldest input to act on, seconds of node time: about five periods of each."""

    frame: float = setting(1.0, "picture, s", 0.05, 10.0)
    estimate: float = setting(0.5, "collision estimate, s", 0.05, 5.0)
    odometry: float = setting(0.25, "odometry, s", 0.05, 2.0)
    tilt: float = setting(0.5, "measured camera tilt, s", 0.05, 10.0)


NAMES = {
    "frame": PICTURE,
    "odometry": "odometry",
    "estimate": "collision estimate",
    "tilt": "camera tilt",
}


def name_of(field_name: str, inputs: SensorInputs) -> str:
    """What an input with an age is called."""
    return inputs.view if field_name == "frame" else NAMES[field_name]


OTHER_CLOCK = {"frame": "its driver read a wrong clock when it started: start the driver again"}
"""Why stamps are wrong where it is not the sender's clock of now. depthai-ros adds the camera's own
time to what the computer's clock said when the driver started (``ImageConverter.cpp``)."""


def needed(lidar: bool = True, tilt: bool = True) -> tuple[str, ...]:
    """Fields of ``SensorInputs`` that must be there, with or without LiDAR and tilting camera."""
    return ("frame", "odometry", *["estimate"] * lidar, *["tilt"] * tilt)


def unusable(
    t: float, inputs: SensorInputs, limits: AgeLimits, lidar: bool = True, tilt: bool = True
) -> str:
    """Name the inputs that are missing or too old.

    Args:
        t: node time, seconds.
        inputs: newest messages.
        limits: oldest allowed.
        lidar: whether the collision estimate is needed.
        tilt: whether the camera tilt is needed.

    Returns:
        One sentence, empty when all can be used.
    """
    found = [input_complaint(t, inputs, n, getattr(limits, n)) for n in needed(lidar, tilt)]
    complaints = [complaint for complaint in found if complaint]
    if not complaints:
        return ""
    text = clocks_differ(t, inputs, limits) or "; ".join(complaints)
    return f"{text[0].upper()}{text[1:]}."


def input_complaint(t: float, inputs: SensorInputs, field_name: str, limit: float) -> str:
    """What is wrong with the age of one input, without capital and full stop; empty if nothing.

    Args:
        t: node time, seconds.
        inputs: newest messages.
        field_name: of ``SensorInputs``, one of ``NAMES``.
        limit: oldest allowed, seconds.
    """
    complaint = _age_complaint(t, inputs, field_name, limit)
    note = inputs.notes.get(field_name, "")
    return f"{complaint} ({note})" if complaint and note else complaint


def _age_complaint(t: float, inputs: SensorInputs, field_name: str, limit: float) -> str:
    name, stamp = name_of(field_name, inputs), inputs.stamps[field_name]
    arrived = inputs.arrived.get(field_name, stamp)
    made = inputs.made(field_name)
    other_clock = OTHER_CLOCK.get(field_name, "the clock of its sender is not this computer's")
    if stamp == NEVER:
        return f"no {name} has arrived"
    if stamp - t > FUTURE_S:
        return f"the {name} is stamped {stamp - t:.1f} s in the future: {other_clock}"
    if t - made <= limit:
        return ""
    if t - arrived > limit:
        driver = "camera's driver" if inputs.view == PICTURE else "detector"
        cure = f": start the {driver} again" if field_name == "frame" else ""
        return f"the newest {name} is {t - made:.2f} s old (limit {limit:g} s){cure}"
    if stamp == 0:
        return f"the {name} arrives without a time, stamped 0: set it in its driver"
    return (
        f"the {name} arrives {arrived - stamp:.2f} s after its stamp (limit {limit:g} s): it is "
        f"late, or {other_clock}"
    )


def clocks_differ(t: float, inputs: SensorInputs, limits: AgeLimits) -> str:
    """A sentence without full stop when all that the robot stamps is off by the same time.

    Args:
        t: node time, seconds.
        inputs: newest messages; those that arrive count.
        limits: an input that came longer ago does not count.
    """
    offsets = []
    for name in ("frame", "odometry"):
        arrived, stamp = inputs.arrived.get(name, NEVER), inputs.stamps[name]
        if t - arrived > getattr(limits, name) or stamp <= 0:
            return ""
        offsets.append(arrived - stamp)
    low, high = min(offsets), max(offsets)
    if high - low > FUTURE_S or min(abs(low), abs(high)) <= FUTURE_S:
        return ""
    cure = "set both with chrony, then start the camera's driver again"
    if abs(low) > OTHER_TIME_S:
        cure = "use_sim_time must be true where /clock is published, and only there"
    return (
        f"the clocks of robot and computer differ by {abs(low):.1f} s (the robot's is "
        f"{'behind' if low > 0 else 'ahead'}): {cure}"
    )
