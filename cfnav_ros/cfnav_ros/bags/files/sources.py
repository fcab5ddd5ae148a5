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

from cfnav_core.robot.robot import Robot, load_robot
from cfnav_core.robot.topics import COMPRESSED, PACKED, TOPICS
from cfnav_ros.bags.files.roles import Role, assign, parse_topics, role_of
from cfnav_ros.bags.files.storage import BagTopic

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


SENSORS: dict[str, Role] = {
    role: role_of(role)
    for role in (
        "image", "camera_info", "detections", "scan", "odom", "hazards", "joint_states", "tf",
        "tf_static", "wheel_status", "dock_status",
    )
}  # fmt: skip
"""What can be played: what a robot said, and nothing that it was told."""


@dataclass(frozen=True)
class PlayedTopic:
    """A topic that is played.

    Attributes:
        role: one of ``SENSORS``.
        topic: in the bag.
        name: under which it is played, from the root.
        offer: how.
    """

    role: str
    topic: BagTopic
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

    sources: tuple[PlayedTopic, ...]
    notes: tuple[str, ...]


def choose(
    topics: Sequence[BagTopic],
    words: Iterable[str] = (),
    namespace: str = "",
    recorded: bool = False,
    robot: Robot | None = None,
) -> Sources:
    """Choose what is played.

    Args:
        topics: of the bag.
        words: ``ROLE:=NAME`` for topics that are not found by their usual name or type.
        namespace: put before every name.
        recorded: under the names in the bag, not those of the live robot.
        robot: the live one, whose names are also looked for in the bag; ``DEFAULT`` when None.

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
    usual = (robot or load_robot()).topics
    live = {role: usual.get(role, TOPICS[role]) for role in SENSORS}
    sensors = {role: role_of(role, topic.name) for role, topic in live.items()}
    roles = assign([t for t in topics if not _is_command(t.name)], named, sensors)
    notes = [*roles.about_robots("a named topic of {} plays that one"), *roles.notes]
    if unfit := [role for role in named if role in roles.missing]:
        raise ValueError(next(note for note in notes if f"given for {unfit[0]} " in note))
    found = []
    for role, topic in roles.topics.items():
        packed = PACKED * (topic.type == COMPRESSED)
        own = live[role].name.removesuffix(PACKED) + packed
        name = (topic.name if recorded else own).lstrip("/")
        if not _NAME.fullmatch(name):
            notes.append(f"{topic.name!r} is left out: it is no name that can be published.")
            continue
        path = f"/{space}/{name}" if space else f"/{name}"
        offer = Offer(live[role].depth, live[role].reliable, live[role].latched)
        found.append(PlayedTopic(role, topic, path, recorded_offer(topic.qos, offer)))
    if not found:
        raise ValueError("The bag holds no topic of a sensor: there is nothing to play.")
    return Sources(tuple(found), tuple(notes))


def recorded_offer(qos: Any, usual: Offer) -> Offer:
    """Return what the recorded publishers of a topic offered.

    Args:
        qos: as ``BagTopic.qos``.
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


def _is_command(name: str) -> bool:
    return any(word in name.lower() for word in COMMANDS)
