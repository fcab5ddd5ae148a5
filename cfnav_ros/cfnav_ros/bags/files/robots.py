"""Which robots a bag holds, by the namespaces of its topics. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

WAYS, RANGES = {"odom", "cmd_vel"}, {"scan", "hazards"}
DRIVEN_BY_SIGHT = {"cmd_vel", "image"}

SHARED = ("tf", "tf_static", "map", "clock")
"""Roles that one topic may play for all robots."""

ROOT = "/"
"""The namespace of a robot that has none."""


def robots_in(played: Iterable[tuple[str, str]]) -> tuple[str, ...]:
    """Find the robots.

    A robot is a namespace with what moves a robot and what it feels its surroundings with; parts of
    one, such as cameras or controllers in namespaces of their own, lack one of the two.

    Args:
        played: role that a topic may play, and name of the topic.

    Returns:
        Their namespaces from the root, such as ``/robot1``, sorted; ``ROOT`` for one without.
    """
    return tuple(sorted(_robots_below("", [(role, _parts(name)) for role, name in played])))


def robot_of(name: str, robots: Sequence[str]) -> str | None:
    """The robot whose namespace a topic is in; ``ROOT``'s are those of no other."""
    around = [r for r in robots if r != ROOT and is_in(name, r)]
    if around:
        return max(around, key=len)
    return ROOT if ROOT in robots else None


def is_in(name: str, namespace: str) -> bool:
    """Whether a topic is in a namespace or in one within it."""
    inside = _parts(namespace)
    return _parts(name)[: len(inside)] == inside


def closeness(name: str, other: str) -> int:
    """How many levels of namespace two topics have in common."""
    pairs = zip(_parts(name)[:-1], _parts(other)[:-1], strict=False)
    equal = [mine == theirs for mine, theirs in pairs]
    return (*equal, False).index(False)


def _parts(name: str) -> list[str]:
    return [part for part in name.split("/") if part]


def _robots_below(namespace: str, played: Sequence[tuple[str, Sequence[str]]]) -> list[str]:
    """The robots in a namespace: those within it, and itself by what belongs to none of them."""
    own = {role for role, parts in played if len(parts) == 1}
    found: list[str] = []
    for part in dict.fromkeys(parts[0] for _, parts in played if len(parts) > 1):
        inner = [(role, parts[1:]) for role, parts in played if parts[0] == part and parts[1:]]
        robots = _robots_below(f"{namespace}/{part}", inner)
        found += robots
        if not robots:
            own |= {role for role, _ in inner}
    if (own & WAYS and own & RANGES) or own >= DRIVEN_BY_SIGHT:
        found.append(namespace or ROOT)
    return found
