"""What of a bag is played: what the robot's sensors said, under which names, offered how. Pure.

What the robot was told, and what was concluded, is none of the roles here, so it cannot be played.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2.metadata import parse_qos

from cfnav_ros.bags.roles import ROLES, Role, assign, parse_topics
from cfnav_ros.bags.storage import Topic

MOST_DEPTH = 1000
"""Messages that a publisher holds, whatever the bag says."""

COMMANDS = ("cmd", "command")
"""In the name of a topic: it tells the robot something, whatever its type."""

_NAME = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)


@dataclass(frozen=True)
class Offer:
    """Quality of service: messages held, delivered for sure, kept for those who come later."""

    depth: int
    reliable: bool = True
    latched: bool = False


_STATUS = Offer(1, latched=True)

USUAL: dict[str, tuple[str, Offer]] = {
    "image": ("oakd/rgb/preview/image_raw", Offer(10)),
    "camera_info": ("oakd/rgb/preview/camera_info", Offer(10)),
    "scan": ("scan", Offer(10)),
    "odom": ("odom", _STATUS),
    "hazards": ("hazard_detection", Offer(5)),
    "joint_states": ("joint_states", Offer(10)),
    "tf": ("tf", Offer(100)),
    "tf_static": ("tf_static", Offer(100, latched=True)),
    "wheel_status": ("wheel_status", _STATUS),
    "dock_status": ("dock_status", _STATUS),
}
"""Name and offer on the live robot, by role."""

SENSORS: dict[str, Role] = {role: ROLES[role] for role in USUAL if role in ROLES} | {
    "wheel_status": Role(("irobot_create_msgs/msg/WheelStatus",), ("wheel_status",)),
    "dock_status": Role(("irobot_create_msgs/msg/DockStatus",), ("dock_status",)),
}


@dataclass(frozen=True)
class Source:
    """A topic that is played.

    Attributes:
        role: one of ``SENSORS``.
        topic: in the bag.
        name: under which it is played, from the root.
        offer: how.
    """

    role: str
    topic: Topic
    name: str
    offer: Offer

    @property
    def kept(self) -> int:
        """How many messages from before the start somebody who comes now should still get."""
        if self.role == "tf_static":  # each message may tell of other frames
            return self.offer.depth
        return int(self.offer.latched)


@dataclass(frozen=True)
class Sources:
    """Topics to play; ``notes`` are sentences about choices and about what is left out."""

    sources: tuple[Source, ...]
    notes: tuple[str, ...]


def choose(
    topics: Sequence[Topic], words: Iterable[str] = (), namespace: str = "", recorded: bool = False
) -> Sources:
    """Choose what is played.

    Args:
        topics: of the bag.
        words: ``ROLE:=NAME`` for topics that are not found by their usual name or type.
        namespace: put before every name.
        recorded: under the names in the bag, not those of the live robot.

    Raises:
        ValueError: a word or the namespace makes no sense, or no sensor was recorded; one sentence.
    """
    space = namespace.strip("/")
    if space and not _NAME.fullmatch(space):
        raise ValueError(f"The namespace is {namespace!r}, expected letters, digits, _ and /.")
    named = parse_topics(words, SENSORS)
    for role, name in named.items():
        if _is_command(name):
            raise ValueError(
                f"The topic {name} that was given for {role} is a command: not played."
            )
    roles = assign([t for t in topics if not _is_command(t.name)], named, SENSORS)
    notes = list(roles.notes)
    if unfit := [role for role in named if role in roles.missing]:
        raise ValueError(next(note for note in notes if f"given for {unfit[0]} " in note))
    found = []
    for role, topic in roles.topics.items():
        name = topic.name.lstrip("/") if recorded else _usual_name(role, topic)
        if not _NAME.fullmatch(name):
            notes.append(f"{topic.name!r} is left out: it is no name that can be published.")
            continue
        path = f"/{space}/{name}" if space else f"/{name}"
        found.append(Source(role, topic, path, recorded_offer(topic.qos, USUAL[role][1])))
    if not found:
        raise ValueError("The bag holds no topic of a sensor: there is nothing to play.")
    return Sources(tuple(found), tuple(notes))


def recorded_offer(qos: Any, usual: Offer) -> Offer:
    """Return what the recorded publishers of a topic offered.

    Args:
        qos: as ``Topic.qos``.
        usual: where the bag says nothing that makes sense.

    Returns:
        The strictest of several: it suits every listener.
    """
    try:
        profiles = parse_qos(qos)
        deepest = max((int(profile.depth) for profile in profiles), default=0)
    except Exception:  # YAML of any shape fails in any way
        return usual
    reliability = {profile.reliability for profile in profiles}
    durability = {profile.durability for profile in profiles}
    reliable, latched = usual.reliable, usual.latched
    if reliability & {QosReliability.RELIABLE, QosReliability.BEST_EFFORT}:
        reliable = QosReliability.RELIABLE in reliability
    if durability & {QosDurability.TRANSIENT_LOCAL, QosDurability.VOLATILE}:
        latched = QosDurability.TRANSIENT_LOCAL in durability
    return Offer(min(deepest, MOST_DEPTH) if deepest > 0 else usual.depth, reliable, latched)


def _usual_name(role: str, topic: Topic) -> str:
    packed = topic.type.endswith("/CompressedImage")
    return USUAL[role][0] + "/compressed" * packed


def _is_command(name: str) -> bool:
    return any(word in name.lower() for word in COMMANDS)
