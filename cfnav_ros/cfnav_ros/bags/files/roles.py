"""Which topic of a bag plays which role: named by the user, else by usual name, else by type."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from cfnav_core.robot.robot import Robot
from cfnav_core.robot.topics import COMPRESSED, DETECTIONS_3D, TOPICS, camera_info
from cfnav_ros.bags.files.robots import ROOT, SHARED, closeness, is_in, robot_of, robots_in
from cfnav_ros.bags.files.storage import BagTopic


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


JUDGED = (
    "image", "camera_info", "detections", "scan", "odom", "cmd_vel", "hazards", "joint_states",
    "tf", "tf_static", "decision", "episode", "estimate", "truth", "map", "clock",
)  # fmt: skip
"""Roles that the evaluation of a bag reads."""

ALSO_NAMED = {
    "image": (
        "rgb/preview/image_raw", "rgb/image_raw", "color/image_raw", "image_raw", "image",
        "image_color", "image_rect", "oakd/rgb/preview/image_raw/compressed",
        "image_raw/compressed", "image/compressed",
    ),
    "camera_info": ("rgb/preview/camera_info", "camera_info"),
    "detections": ("nn/spatial_detections", "detections_output"),
    "cmd_vel": ("cmd_vel_unstamped",),
    "map": ("map",),
}  # fmt: skip
"""Usual names besides that in the table of topics, which comes first."""

NO_COLOURS = ("depth", "stereo", "disparity", "infra")
COLOURS = ("color", "colour", "rgb")
SOMETHING_ELSE = {"image": NO_COLOURS, "camera_info": NO_COLOURS, "map": ("costmap",)}


def role_of(role: str, own: str = "") -> Role:
    """How a topic of the table is found in any bag; ``own`` is the name that a robot gives it."""
    topic = TOPICS[role]
    other = {"image": COMPRESSED, "detections": DETECTIONS_3D}.get(role, topic.other_type)
    names = (own, topic.name, *ALSO_NAMED.get(role, ()))
    return Role(
        types=(topic.type, other) if other else (topic.type,),
        names=tuple(name.lstrip("/") for name in names if name),
        by_type=role not in ("tf", "tf_static", "detections"),
        other=SOMETHING_ELSE.get(role, ()),
    )


ROLES = {role: role_of(role) for role in JUDGED}


def names_of(robot: Robot) -> dict[str, str]:
    """Names by role that a robot has instead of the usual ones; its calibration may be absent."""
    return {
        role: topic.name
        for role, topic in robot.topics.items()
        if topic.name != TOPICS[role].name and role in ROLES and role != "camera_info"
    }


@dataclass(frozen=True)
class Roles:
    """Which topic plays which role.

    Attributes:
        topics: by role.
        notes: sentences about choices.
        missing: roles without a topic.
        robots: namespaces of the robots of the bag when there are several and none was asked for.
        robot: the one of them that was chosen.
    """

    topics: Mapping[str, BagTopic]
    notes: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    robots: tuple[str, ...] = ()
    robot: str = ""

    def about_robots(self, how: str) -> tuple[str, ...]:
        """A sentence when one of several robots was chosen; ``how`` another is, {} for its name."""
        if not self.robots:
            return ()
        names, other = ", ".join(self.robots), next(r for r in self.robots if r != self.robot)
        another = how.format(other)
        return (f"The bag holds several robots, {names}: {self.robot} was chosen, {another}.",)


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
    topics: Sequence[BagTopic],
    named: Mapping[str, str] | None = None,
    roles: Mapping[str, Role] = ROLES,
    namespace: str = "",
) -> Roles:
    """Find the topic for every role, all of them of one robot and one camera.

    Args:
        topics: of a bag.
        named: names by role that the user gave.
        roles: that are to be played.
        namespace: of the robot, "/" for one without; when not given it is that of the named
            topics, else the one with most roles.

    Returns:
        The roles; one that was named and cannot be played by that topic is missing.
    """
    return _Assigning(topics, named or {}, roles, namespace).done()


class _Assigning:
    """Chooses for one role after the other, what is named first."""

    def __init__(
        self,
        topics: Sequence[BagTopic],
        named: Mapping[str, str],
        roles: Mapping[str, Role],
        namespace: str,
    ) -> None:
        self._topics, self._named, self._wanted = topics, named, roles
        self._chosen: dict[str, BagTopic] = {}
        self._notes: dict[str, str] = {}
        asked = f"/{namespace.strip('/')}" if namespace else ""
        inside = [t for t in topics if asked and is_in(t.name, asked)]
        spoken = [t for t in topics if t.count != 0 and (asked == ROOT or t not in inside)]
        played = [(role, t.name) for role, w in roles.items() for t in spoken if t.type in w.types]
        found = robots_in(played)
        self._robots = tuple(dict.fromkeys((*found, *([asked] * bool(asked)))))
        self._robot = asked or self._robot_of_named()
        self._told = () if asked or len(found) < 2 else found
        if self._robot is None and self._told:
            has = {r: len({role for role, n in played if robot_of(n, found) == r}) for r in found}
            self._robot = max(found, key=has.__getitem__)
        if asked and not inside:
            there = f", its robots are {', '.join(found)}" if found else ""
            self._notes[""] = f"The bag holds no topic in the namespace {asked}{there}."
            self._topics = ()

    def done(self) -> Roles:
        """Choose; what a calibration belongs to stands before it in every table of roles."""
        for role in dict.fromkeys((*self._named, "odom", *self._wanted)):
            if role in self._wanted:
                self._choose(role, self._wanted[role])
        topics = {role: self._chosen[role] for role in self._wanted if role in self._chosen}
        notes = [self._notes[role] for role in ("", *self._wanted) if role in self._notes]
        missing = tuple(role for role in self._wanted if role not in topics)
        return Roles(topics, tuple(notes), missing, self._told, self._robot or "")

    def _robot_of_named(self) -> str | None:
        """The robot that a named topic belongs to, None when none does or all robots have it."""
        if len(self._robots) < 2:
            return None
        for name in self._named.values():
            robots = {robot_of(t.name, self._robots) for t in _named(self._topics, name)}
            if len(robots) == 1 and (robot := robots.pop()):
                return robot
        return None

    def _choose(self, role: str, wanted: Role) -> None:
        name = self._named.get(role)
        if name is None:
            found = self._of_camera(role, self._candidates(role, wanted))
        else:
            found = _named(self._topics, name)
            unfit = _unfit(role, name, wanted, found)
            found = [t for t in found if t.type in wanted.types]
            if not found:
                self._notes[role] = unfit
            found = [t for t in found if self._is_ours(role, t)] or found
        found.sort(key=lambda topic: self._rank(wanted, topic))
        if len(found) > 1:
            others = ", ".join(told(topic) for topic in found[1:])
            self._notes[role] = f"For {role} {told(found[0])} was chosen, there are also {others}."
        if found:
            self._chosen[role] = found[0]

    def _candidates(self, role: str, wanted: Role) -> list[BagTopic]:
        """Topics of our robot that fit by name or, without one, by type."""
        fitting = [t for t in self._topics if t.type in wanted.types and self._is_ours(role, t)]
        if not wanted.by_type:
            return [t for t in fitting if _place(wanted, t) < len(wanted.names)]
        found = [topic for topic in fitting if not _is_other(wanted, topic)]
        if fitting and not found:
            left = ", ".join(told(topic) for topic in fitting)
            self._notes[role] = (
                f"For {role} nothing was chosen: by its name {left} is something else; "
                f"{role}:=NAME chooses it all the same."
            )
        return found

    def _is_ours(self, role: str, topic: BagTopic) -> bool:
        """Whether a topic is our robot's, or may be as it is no other's."""
        if self._robot is None:
            return True
        robot = robot_of(topic.name, self._robots)
        return robot in (None, self._robot) or (robot == ROOT and role in SHARED)

    def _of_camera(self, role: str, found: list[BagTopic]) -> list[BagTopic]:
        """Of calibrations that of the chosen picture, or else those of no other camera.

        A bag with detections needs no pictures: then it is that of those that a robot would have.
        """
        if role != "camera_info":
            return found
        image = self._chosen.get("image")
        if image is None:
            usual = self._named.get("image", TOPICS["image"].name)
            return _named(found, camera_info(usual)) or found
        own = [topic for topic in found if topic.name == camera_info(image.name)]
        pictures = [t for t in self._topics if t.type in self._wanted["image"].types]
        others = {camera_info(picture.name) for picture in pictures}
        return own or [topic for topic in found if topic.name not in others]

    def _rank(self, wanted: Role, topic: BagTopic) -> tuple[object, ...]:
        """Sorting key: not empty, ours, usual name, near the first choice, messages, type."""
        count, kind = topic.count, wanted.types.index(topic.type)
        ours = self._robot is None or robot_of(topic.name, self._robots) == self._robot
        anchor = next(iter(self._chosen.values()), topic)
        return (
            count == 0, not ours, _place(wanted, topic), -closeness(topic.name, anchor.name),
            -(count or 0), kind, topic.name,
        )  # fmt: skip


def _is_other(wanted: Role, topic: BagTopic) -> bool:
    """Whether the name tells of something else: of its parts the last that tells counts."""
    for part in reversed(topic.name.lower().split("/")):
        if any(word in part for word in wanted.other):
            return True
        if wanted.other is NO_COLOURS and any(word in part for word in COLOURS):
            return False
    return False


def _named(topics: Sequence[BagTopic], name: str) -> list[BagTopic]:
    """Topics with a name; one that begins without a slash may stand in any namespace."""
    exact = [t for t in topics if t.name.lstrip("/") == name.lstrip("/")]
    if exact or name.startswith("/"):
        return exact
    return [t for t in topics if t.name.endswith("/" + name)]


def _place(wanted: Role, topic: BagTopic) -> int:
    """Where the topic's name stands among the usual ones; their number when it is none."""
    ends = [("/" + topic.name).endswith("/" + name) for name in wanted.names]
    return ends.index(True) if True in ends else len(ends)


def _unfit(role: str, name: str, wanted: Role, found: Sequence[BagTopic]) -> str:
    """Why a named topic cannot play its role."""
    if not found:
        return f"The topic {name} that was given for {role} is not in the bag."
    types = " or ".join(wanted.types)
    return f"The topic {name} that was given for {role} holds {found[0].type}, expected {types}."


def told(topic: BagTopic) -> str:
    """A topic in a sentence."""
    count = "" if topic.count is None else f", {topic.count} messages"
    return f"{topic.name} ({topic.type.rpartition('/')[2]}{count})"
