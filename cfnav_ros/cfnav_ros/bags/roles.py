"""Which topic of a bag plays which role: named by the user, else by usual name, else by type."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from cfnav_ros.bags.storage import Topic


@dataclass(frozen=True)
class Role:
    """What a topic is needed for.

    Attributes:
        types: message types that can play it.
        names: usual last names, the most usual first.
        by_type: a topic of one of the types plays it whatever its name is.
        other: words in the name of a topic of that type which is something else.
    """

    types: tuple[str, ...]
    names: tuple[str, ...]
    by_type: bool = True
    other: tuple[str, ...] = ()


NO_COLOURS = ("depth", "stereo", "disparity", "infra")

ROLES: dict[str, Role] = {
    "image": Role(
        ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"),
        (
            "oakd/rgb/preview/image_raw", "rgb/preview/image_raw", "rgb/image_raw",
            "color/image_raw", "image_raw", "image", "image_color", "image_rect",
            "oakd/rgb/preview/image_raw/compressed", "image_raw/compressed", "image/compressed",
        ),
        other=NO_COLOURS,
    ),
    "camera_info": Role(
        ("sensor_msgs/msg/CameraInfo",),
        ("oakd/rgb/preview/camera_info", "rgb/preview/camera_info", "camera_info"),
        other=NO_COLOURS,
    ),
    "scan": Role(("sensor_msgs/msg/LaserScan",), ("scan",)),
    "odom": Role(("nav_msgs/msg/Odometry",), ("odom",)),
    "cmd_vel": Role(
        ("geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist"),
        ("cmd_vel", "cmd_vel_unstamped"),
    ),
    "hazards": Role(("irobot_create_msgs/msg/HazardDetectionVector",), ("hazard_detection",)),
    "joint_states": Role(("sensor_msgs/msg/JointState",), ("joint_states",)),
    "tf": Role(("tf2_msgs/msg/TFMessage",), ("tf",), by_type=False),
    "tf_static": Role(("tf2_msgs/msg/TFMessage",), ("tf_static",), by_type=False),
    "decision": Role(("cfnav_interfaces/msg/PolicyDecision",), ("policy/decision",)),
    "episode": Role(("cfnav_interfaces/msg/EpisodeStatus",), ("policy/episode",)),
    "estimate": Role(("cfnav_interfaces/msg/CollisionEstimate",), ("collision/estimate",)),
    "truth": Role(("cfnav_interfaces/msg/GroundTruth",), ("ground_truth/state",)),
    "map": Role(("nav_msgs/msg/OccupancyGrid",), ("ground_truth/map", "map"), other=("costmap",)),
    "clock": Role(("rosgraph_msgs/msg/Clock",), ("clock",)),
}  # fmt: skip


@dataclass(frozen=True)
class Roles:
    """Topics by role; ``notes`` are sentences about choices, ``missing`` the roles without one."""

    topics: Mapping[str, Topic]
    notes: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()


def parse_topics(words: Iterable[str], roles: Mapping[str, Role] = ROLES) -> dict[str, str]:
    """Read ``ROLE:=NAME`` from a command line.

    Args:
        words: such as ``image:=/camera/color/image_raw``.
        roles: that can be named.

    Returns:
        Names by role.

    Raises:
        ValueError: a word of another form, an unknown role, or a role twice; one sentence.
    """
    named: dict[str, str] = {}
    for word in words:
        role, middle, name = word.partition(":=")
        if not middle or not name or role not in roles:
            raise ValueError(
                f"The topic {word!r} is not understood, expected ROLE:=NAME with ROLE one of "
                f"{', '.join(roles)}."
            )
        if role in named:
            raise ValueError(f"The role {role} is given twice, as {named[role]} and {name}.")
        named[role] = name
    return named


def assign(
    topics: Sequence[Topic],
    named: Mapping[str, str] | None = None,
    roles: Mapping[str, Role] = ROLES,
) -> Roles:
    """Find the topic for every role.

    Args:
        topics: of a bag.
        named: names by role that the user gave.
        roles: that are to be played.

    Returns:
        The roles; one that was named and cannot be played by that topic is missing.
    """
    chosen: dict[str, Topic] = {}
    notes: list[str] = []
    for role, wanted in roles.items():
        name = (named or {}).get(role)
        if name is None:
            found = _candidates(wanted, topics)
        else:
            found = _named(topics, name)
            note = _unfit(role, name, wanted, found)
            found = [t for t in found if t.type in wanted.types]
            notes += [note] if note and not found else []
        found.sort(key=lambda topic: _rank(wanted, topic))
        if len(found) > 1:
            others = ", ".join(_told(topic) for topic in found[1:])
            notes.append(f"For {role} {_told(found[0])} was chosen, there are also {others}.")
        if found:
            chosen[role] = found[0]
    missing = tuple(role for role in roles if role not in chosen)
    return Roles(chosen, tuple(notes), missing)


def _candidates(wanted: Role, topics: Sequence[Topic]) -> list[Topic]:
    """Topics that fit by name or, without one, by type."""
    fitting = [
        topic
        for topic in topics
        if topic.type in wanted.types and not any(word in topic.name for word in wanted.other)
    ]
    return [t for t in fitting if wanted.by_type or _place(wanted, t) < len(wanted.names)]


def _named(topics: Sequence[Topic], name: str) -> list[Topic]:
    """Topics with a name; one that begins without a slash may stand in any namespace."""
    exact = [t for t in topics if t.name.lstrip("/") == name.lstrip("/")]
    if exact or name.startswith("/"):
        return exact
    return [t for t in topics if t.name.endswith("/" + name)]


def _place(wanted: Role, topic: Topic) -> int:
    """Where the topic's name stands among the usual ones; their number when it is none."""
    ends = [("/" + topic.name).endswith("/" + name) for name in wanted.names]
    return ends.index(True) if True in ends else len(ends)


def _rank(wanted: Role, topic: Topic) -> tuple[bool, int, int, int, str]:
    """Sorting key: not empty, most usual name, most messages, first type."""
    count = topic.count
    kind = wanted.types.index(topic.type)
    return count == 0, _place(wanted, topic), -(count or 0), kind, topic.name


def _unfit(role: str, name: str, wanted: Role, found: Sequence[Topic]) -> str:
    """Why a named topic cannot play its role."""
    if not found:
        return f"The topic {name} that was given for {role} is not in the bag."
    types = " or ".join(wanted.types)
    return f"The topic {name} that was given for {role} holds {found[0].type}, expected {types}."


def _told(topic: Topic) -> str:
    """A topic in a sentence."""
    count = "" if topic.count is None else f", {topic.count} messages"
    return f"{topic.name} ({topic.type.rpartition('/')[2]}{count})"
