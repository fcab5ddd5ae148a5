"""A recorded bag as typed events, maps and pictures; read as a stream, without ROS.

Topics are recognised by their last names, so a bag of a namespaced robot reads the same.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from cfnav_core.actions import Action
from cfnav_ros.lidar import Scan
from cfnav_ros.outcome import Decision, Estimate, Events, Status, Truth

IMAGE = "oakd/rgb/preview/image_raw"
DECISION = "policy/decision"
EPISODE = "policy/episode"
ESTIMATE = "collision/estimate"
TRUTH = "ground_truth/state"
MAP = "ground_truth/map"
SCAN = "scan"
ODOMETRY = "odom"

_STARTED = 0
"""``EpisodeStatus.STARTED``."""


class BagError(Exception):
    """A bag that cannot be read or lacks what is asked; the text is one sentence."""


@dataclass(frozen=True)
class RoomMap:
    """Occupancy of a room: ``occupied`` bool [H, W], row 0 at the lowest y; metres."""

    t_ns: int
    occupied: np.ndarray
    resolution: float
    origin: tuple[float, float]


def read_events(bag: Path) -> Events:
    """Read everything but pictures and maps.

    Raises:
        BagError: the bag cannot be read or holds no episode.
    """
    lists: dict[str, list] = {topic: [] for topic in _CONVERT}
    for topic, _, message in _messages(bag, lists):
        lists[topic].append(_CONVERT[topic](message))
    if not lists[EPISODE]:
        raise BagError(f"{bag} holds no message of {EPISODE}: no episode was recorded")
    for events in lists.values():
        events.sort(key=lambda event: event.t_ns)
    return Events(lists[EPISODE], lists[DECISION], lists[TRUTH], lists[ESTIMATE])


def read_maps(bag: Path) -> list[RoomMap]:
    """Read the room maps in the order of their log times."""
    return [_room_map(t_ns, message) for _, t_ns, message in _messages(bag, (MAP,))]


def read_pictures(bag: Path, stamps_ns: Collection[int]) -> dict[int, np.ndarray]:
    """Read the pictures with the given stamps.

    Args:
        bag: the bag.
        stamps_ns: stamps of the wanted pictures, nanoseconds.

    Returns:
        uint8 [H, W, 3] RGB by stamp; stamps without a picture are left out.

    Raises:
        BagError: the bag cannot be read or a picture has an encoding other than bgr8 or rgb8.
    """
    wanted = set(stamps_ns)
    pictures = {}
    for _, _, message in _messages(bag, (IMAGE,)):
        stamp = _ns(message.header.stamp)
        if stamp in wanted:
            pictures[stamp] = _rgb(message)
    return pictures


def read_scans(bag: Path) -> list[Scan]:
    """Read the laser scans in the order of their log times."""
    return [_scan(message) for _, _, message in _messages(bag, (SCAN,))]


def read_yaws(bag: Path) -> np.ndarray:
    """Read the headings of the odometry.

    Returns:
        float64 [N], radians counter-clockwise in [-pi, pi], in the order of their log times.
    """
    rotations = [m.pose.pose.orientation for _, _, m in _messages(bag, (ODOMETRY,))]
    return np.array([2.0 * math.atan2(q.z, q.w) for q in rotations], np.float64)


def _messages(bag: Path, topics: Collection[str]) -> Iterator[tuple[str, int, Any]]:
    """Yield (topic, log time in ns, message) of the given topics in the order of their times."""
    try:
        with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            names = {c.topic: name for c in reader.connections if (name := _short(c.topic, topics))}
            chosen = [c for c in reader.connections if c.topic in names]
            for connection, t_ns, raw in reader.messages(chosen) if chosen else ():
                yield names[connection.topic], t_ns, reader.deserialize(raw, connection.msgtype)
    except FileNotFoundError:
        raise BagError(f"{bag} does not exist; expected a bag folder or a .mcap file") from None
    except Exception as error:  # a damaged file fails anywhere in the decoder, in any way
        raise BagError(f"{bag} cannot be read as a bag, it is damaged: {error}") from error


def _short(topic: str, wanted: Collection[str]) -> str | None:
    """Return the wanted name that a topic ends with."""
    return next((name for name in wanted if ("/" + topic).endswith("/" + name)), None)


def _ns(stamp: Any) -> int:
    """Return a stamp as nanoseconds."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def _truth(m: Any) -> Truth:
    return Truth(
        t_ns=_ns(m.header.stamp),
        x=m.x,
        y=m.y,
        yaw=m.yaw,
        collisions=m.collisions,
        goal_visible=bool(m.goal_visible),
        room=m.room,
        goal=m.goal,
        shortest_path=m.shortest_path,
        contact_with=m.contact_with,
    )


def _decision(m: Any) -> Decision:
    return Decision(
        t_ns=_ns(m.header.stamp),
        image_ns=_ns(m.image_stamp),
        step=m.step,
        action=Action(m.action),
        collision_probability=m.collision_probability,
        detection_score=m.detection_score,
        vetoed=bool(m.vetoed),
    )


def _status(m: Any) -> Status:
    return Status(
        t_ns=_ns(m.header.stamp),
        started=m.phase == _STARTED,
        goal=m.goal,
        bundle=m.bundle,
        outcome=m.outcome,
        message=m.message,
    )


def _estimate(m: Any) -> Estimate:
    return Estimate(_ns(m.header.stamp), m.probability, m.clearance)


_CONVERT = {EPISODE: _status, DECISION: _decision, TRUTH: _truth, ESTIMATE: _estimate}


def _room_map(t_ns: int, m: Any) -> RoomMap:
    cells = np.asarray(m.data, dtype=np.int8).reshape(m.info.height, m.info.width)
    origin = m.info.origin.position
    return RoomMap(t_ns, cells > 0, m.info.resolution, (origin.x, origin.y))


def _scan(m: Any) -> Scan:
    """Return a LaserScan message."""
    return Scan(
        m.ranges, m.angle_min, m.angle_max, m.angle_increment, m.range_min, m.range_max,
        m.header.frame_id,
    )  # fmt: skip


def _rgb(m: Any) -> np.ndarray:
    """Return an Image message as uint8 [H, W, 3] RGB."""
    if m.encoding not in ("bgr8", "rgb8"):
        raise BagError(f"a picture has the encoding {m.encoding!r}; expected bgr8 or rgb8")
    rows = np.asarray(m.data, dtype=np.uint8).reshape(m.height, m.step)
    pixels = rows[:, : m.width * 3].reshape(m.height, m.width, 3)
    return pixels[..., ::-1] if m.encoding == "bgr8" else pixels
