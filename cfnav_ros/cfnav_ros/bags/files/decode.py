"""A recorded message -> its event, by the rules of the live nodes where they have any."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from typing import Any

import numpy as np

from cfnav_core.task.actions import Action
from cfnav_ros.bags.files.events import (
    Bumps,
    Calibrated,
    Decided,
    Detected,
    Event,
    Frames,
    Joint,
    Judged,
    LaserTurn,
    OccupancyMap,
    Picture,
    Pose,
    Tick,
    Told,
    Truth,
    Unreadable,
    Velocity,
)
from cfnav_ros.bags.files.storage import BagTopic
from cfnav_ros.drive.fields import (
    bump_zones,
    detections_from_message,
    estimate_from_message,
    odometry_from_message,
    pinhole_from_message,
    scan_from_message,
    stamp_to_ns,
    tilt_from_message,
    yaw_of,
)
from cfnav_ros.robot import pictures

TILT_JOINT = "camera_tilt"
"""Name of the camera's tilt in joint_states, as in ``PolicyParameters``."""

MAX_CELLS = 20_000 * 20_000
"""Larger maps are of no building."""

OCCUPIED = 65
"""Percent from which a cell of a map is a wall: the default ``occupied_thresh`` 0.65 of Nav2's
map_server, whose map saver takes it so too (nav2_map_server, ``map_io.cpp``)."""

_STARTED, _ENDED = 0, 1
"""``EpisodeStatus.STARTED`` and ``ENDED``."""


def decode(
    role: str,
    topic: BagTopic,
    log_ns: int,
    data: bytes,
    read: Callable[[bytes], Any],
    tilt_joint: str = TILT_JOINT,
) -> Event | None:
    """Turn a message into an event.

    Args:
        role: one of ``roles.ROLES``.
        topic: it was recorded on.
        log_ns: when it was recorded, nanoseconds.
        data: CDR.
        read: deserializes it.
        tilt_joint: name of the camera's tilt in joint_states.

    Returns:
        The event, ``Unreadable`` for a message that makes no sense, None for one that says nothing
        of its role. A stamp of zero, by which ROS means none, is replaced by the log time.
    """
    about: dict[str, Any] = {"log_ns": log_ns, "topic": topic.name}
    try:
        message = read(data)
    except Exception as error:  # damaged bytes fail anywhere in the deserializer, in any way
        return Unreadable(t_ns=log_ns, reason=f"The message is damaged: {error}", **about)
    try:
        dated = {"t_ns": _stamp(message, log_ns), **about}
        if role == "joint_states":
            return _joint(message, dated, tilt_joint)
        return _EVENTS[role](message, dated)
    except (ValueError, OverflowError) as error:
        reason = str(error)
    except AttributeError as error:  # its definition in the bag lacks a field
        reason = f"The message is no {topic.type}: {error}."
    return Unreadable(t_ns=log_ns, reason=reason, **about)


def _stamp(message: Any, log_ns: int) -> int:
    """The stamp of a message, its log time when it has none."""
    if hasattr(message, "clock"):
        return _checked(message.clock)
    if hasattr(message, "transforms") and message.transforms:
        message = message.transforms[0]
    return (_checked(message.header.stamp) if hasattr(message, "header") else 0) or log_ns


def _checked(stamp: Any) -> int:
    """Nanoseconds of a stamp.

    Raises:
        ValueError: it is no time.
    """
    if stamp.sec < 0 or stamp.nanosec >= 1_000_000_000:
        raise ValueError(f"The stamp is {stamp.sec} s and {stamp.nanosec} ns, which is no time.")
    return stamp_to_ns(stamp)


def _finite(what: str, *values: float) -> None:
    """Refuse what is not finite.

    Raises:
        ValueError: one sentence.
    """
    if not all(map(math.isfinite, values)):
        raise ValueError(f"{what} holds a value that is not finite.")


def _picture(message: Any, about: dict[str, Any]) -> Picture:
    if hasattr(message, "encoding"):
        pictures.check(message)
        decoder: Callable[[Any], np.ndarray] = pictures.image_to_rgb
    else:
        pictures.check_compressed(message)
        decoder = pictures.compressed_to_rgb
    return Picture(data=message.data, decode=partial(decoder, message), **about)


def _pose(message: Any, about: dict[str, Any]) -> Pose:
    o = odometry_from_message(message)
    frames = f"{message.header.frame_id} to {message.child_frame_id}"
    return Pose(x=o.x, y=o.y, yaw=o.yaw, v=o.v, w=o.w, frames=frames, **about)


def _velocity(message: Any, about: dict[str, Any]) -> Velocity:
    twist = getattr(message, "twist", message)
    _finite("The velocity command", twist.linear.x, twist.angular.z)
    return Velocity(v=twist.linear.x, w=twist.angular.z, **about)


def _joint(message: Any, about: dict[str, Any], joint: str) -> Joint | None:
    tilt = tilt_from_message(message, joint)
    return Joint(angle=tilt.angle, **about) if tilt else None


def _frames(message: Any, about: dict[str, Any]) -> Frames:
    transforms = []
    for each in message.transforms:
        at, q = each.transform.translation, each.transform.rotation
        parent, child = each.header.frame_id, each.child_frame_id
        place, turn = (at.x, at.y, at.z), (q.x, q.y, q.z, q.w)
        _finite(f"The transform from {parent!r} to {child!r}", *place, *turn)
        transforms.append((parent, child, place, turn))
    return Frames(transforms=tuple(transforms), **about)


def _decided(message: Any, about: dict[str, Any]) -> Decided:
    if message.action >= len(Action):
        raise ValueError(f"The decision is action {message.action}, expected 0 to 5.")
    probabilities = np.asarray(message.action_probabilities, np.float32)
    if probabilities.shape != (len(Action),) or not np.isfinite(probabilities).all():
        raise ValueError("The decision holds no probability of every action.")
    _finite("The decision", message.collision_probability, message.detection_score)
    return Decided(
        goal=message.goal,
        image_ns=_checked(message.image_stamp),
        estimate_ns=_checked(message.estimate_stamp),
        step=message.step,
        action=Action(message.action),
        probabilities=probabilities,
        collision_probability=message.collision_probability,
        detection_score=message.detection_score,
        vetoed=bool(message.vetoed),
        met_before=bool(getattr(message, "met_before", False)),
        by_detections=bool(getattr(message, "by_detections", False)),
        **about,
    )


def _told(message: Any, about: dict[str, Any]) -> Told:
    if message.phase not in (_STARTED, _ENDED):
        raise ValueError(f"The episode's phase is {message.phase}, expected 0 or 1.")
    return Told(
        started=message.phase == _STARTED,
        goal=message.goal,
        bundle=message.bundle,
        outcome=message.outcome,
        message=message.message,
        **about,
    )


def _truth(message: Any, about: dict[str, Any]) -> Truth:
    """The sample, whose fields have the names of the message's."""
    m = message
    _finite("The ground truth", m.x, m.y, m.yaw, m.v, m.impact_speed, m.shortest_path)
    own = [field.name for field in fields(Truth) if field.name not in about]
    return Truth(**{name: getattr(m, name) for name in own}, **about)


def _map(message: Any, about: dict[str, Any]) -> OccupancyMap:
    """The map; its cells are percent, those from ``OCCUPIED`` are walls, others and -1 are not."""
    info, cells = message.info, np.asarray(message.data, np.int8)
    if not 0 < info.width * info.height <= MAX_CELLS or cells.size != info.width * info.height:
        raise ValueError(f"The map says {info.width}x{info.height} and holds {cells.size} cells.")
    origin = info.origin.position
    _finite("The map", info.resolution, origin.x, origin.y)
    if info.resolution <= 0.0:
        raise ValueError(f"The map's cells are {info.resolution} m wide, expected more than 0.")
    yaw = yaw_of(info.origin.orientation, "The map")
    if abs(yaw) > 1e-3:
        raise ValueError(f"The map is turned by {yaw:.3f} rad, expected one along its frame.")
    return OccupancyMap(
        occupied=cells.reshape(info.height, info.width) >= OCCUPIED,
        resolution=info.resolution,
        origin=(origin.x, origin.y),
        **about,
    )


_EVENTS: dict[str, Callable[[Any, dict[str, Any]], Event | None]] = {
    "image": _picture,
    "detections": lambda message, about: Detected(
        claims=tuple(detections_from_message(message)), **about
    ),
    "camera_info": lambda message, about: Calibrated(found=pinhole_from_message(message), **about),
    "scan": lambda message, about: LaserTurn(scan=scan_from_message(message), **about),
    "odom": _pose,
    "cmd_vel": _velocity,
    "hazards": lambda message, about: Bumps(zones=bump_zones(message), **about),
    "tf": _frames,
    "tf_static": _frames,
    "decision": _decided,
    "episode": _told,
    "estimate": lambda message, about: Judged(
        estimate=estimate_from_message(message).estimate, **about
    ),
    "truth": _truth,
    "map": _map,
    "clock": lambda message, about: Tick(**about),
}

WITH_EVENTS = frozenset((*_EVENTS, "joint_states"))
"""Roles whose messages are events."""
