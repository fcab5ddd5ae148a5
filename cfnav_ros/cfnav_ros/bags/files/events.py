"""What a bag holds, as typed events in the order of their log times.

Pure. ``t_ns`` is the stamp that its publisher gave an event, ``log_ns`` when it was recorded; both
are integer nanoseconds, so that they can be compared exactly. A message without a stamp has its
log time as stamp.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from cfnav_core.task.actions import Action
from cfnav_core.task.pinhole import Pinhole
from cfnav_ros.drive.fields import Claim
from cfnav_ros.lidar.estimate import Estimate, Scan


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something that was recorded; ``topic`` is its name in the bag."""

    t_ns: int
    log_ns: int = 0
    topic: str = ""


@dataclass(frozen=True, kw_only=True)
class Picture(Event):
    """A camera picture, decoded only when somebody looks at it.

    Attributes:
        data: its pixels as recorded, to tell a repeated picture from a new one.
        decode: gives uint8 [H, W, 3] RGB; ValueError with one sentence when it cannot.
    """

    data: bytes | memoryview | np.ndarray = field(repr=False)
    decode: Callable[[], np.ndarray] = field(repr=False)


@dataclass(frozen=True, kw_only=True)
class Detected(Event):
    """What a detector says of the picture with this stamp."""

    claims: tuple[Claim, ...]


@dataclass(frozen=True, kw_only=True)
class Calibrated(Event):
    """What camera_info says of the camera."""

    found: Pinhole


@dataclass(frozen=True, kw_only=True)
class LaserTurn(Event):
    """One turn of the laser scanner."""

    scan: Scan


@dataclass(frozen=True, kw_only=True)
class Pose(Event):
    """Odometry: metres, radians counter-clockwise, m/s, rad/s; ``frames`` names its two."""

    x: float
    y: float
    yaw: float
    v: float
    w: float
    frames: str = ""


@dataclass(frozen=True, kw_only=True)
class Velocity(Event):
    """What the base was told: m/s, rad/s."""

    v: float
    w: float


@dataclass(frozen=True, kw_only=True)
class Bumps(Event):
    """One report of the bumper: the zones that are pressed, by their frames; none when free."""

    zones: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Joint(Event):
    """The camera's tilt, radians, negative down."""

    angle: float


@dataclass(frozen=True, kw_only=True)
class Frames(Event):
    """Transforms: (parent, child, (x, y, z) in metres, (qx, qy, qz, qw))."""

    transforms: tuple[
        tuple[str, str, tuple[float, float, float], tuple[float, float, float, float]], ...
    ]


@dataclass(frozen=True, kw_only=True)
class Judged(Event):
    """The LiDAR node's estimate; ``t_ns`` is the stamp of the scan it was made from."""

    estimate: Estimate


@dataclass(frozen=True, kw_only=True)
class Decided(Event):
    """One decision of the policy that drove, published before it was executed.

    Attributes:
        goal: object that is sought.
        image_ns: stamp of the picture it was taken on.
        estimate_ns: stamp of the scan its collision probability came from; 0: the bundle's own.
        step: 1-based within the episode.
        action: index of ``Action``.
        probabilities: float32 [6].
        collision_probability: p_hat as given to the policy.
        detection_score: 0..1.
        vetoed: decided but not executed.
        met_before: whether a MoveAhead of the drive was stopped in this way ahead; bags recorded
            before this was remembered do not say it.
        by_detections: whether the score is a detector's; bags from before do not say it.
    """

    goal: str
    image_ns: int
    estimate_ns: int
    step: int
    action: Action
    probabilities: np.ndarray
    collision_probability: float
    detection_score: float
    vetoed: bool
    met_before: bool = False
    by_detections: bool = False


@dataclass(frozen=True, kw_only=True)
class Told(Event):
    """The start or the end of an episode, as the policy node published it."""

    started: bool
    goal: str
    bundle: str
    outcome: str
    message: str


@dataclass(frozen=True, kw_only=True)
class Truth(Event):
    """One sample of a simulator's ground truth: metres, radians, room frame."""

    x: float
    y: float
    yaw: float
    v: float
    collisions: int
    contact_with: str
    impact_speed: float
    goal: str
    goal_visible: bool
    room: str
    shortest_path: float


@dataclass(frozen=True, kw_only=True)
class OccupancyMap(Event):
    """A map: ``occupied`` bool [H, W], row 0 at the lowest y; metres."""

    occupied: np.ndarray
    resolution: float
    origin: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Tick(Event):
    """One message of /clock: ``t_ns`` is the time that it tells."""


@dataclass(frozen=True, kw_only=True)
class Unreadable(Event):
    """A message that makes no sense; ``reason`` is one sentence."""

    reason: str
