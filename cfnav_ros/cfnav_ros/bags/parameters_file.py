"""A robot's ROS parameter file -> how its nodes judged and decided. Needs no ROS.

Such as those of cfnav_bringup: node names, also with ``/**``, above ``ros__parameters``. Other
nodes in the file are of no concern here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import yaml

from cfnav_ros.mounting import MOUNT
from cfnav_ros.policy_parameters import PolicyParameters
from cfnav_ros.scan_watch import LidarParameters
from cfnav_ros.settings import OF_RCLPY, leaves, settled

T = TypeVar("T")

EVERY_NODE = "/**"
BELOW = "ros__parameters"


class ParametersError(ValueError):
    """The file cannot be used; the text is one sentence."""


@dataclass(frozen=True)
class RobotParameters:
    """What a parameter file says of the two nodes.

    Attributes:
        policy: of ``policy_node``.
        lidar: of ``lidar_collision_node``.
        mount_given: the file says where the LiDAR sits.
        image_topic: of the camera, empty when the file does not say.
    """

    policy: PolicyParameters
    lidar: LidarParameters
    mount_given: bool
    image_topic: str


def read_parameters(path: Path) -> RobotParameters:
    """Read a parameter file.

    Raises:
        ParametersError: it cannot be read, names neither node, or gives a node a parameter that it
            does not have or refuses; one sentence.
    """
    try:
        said = yaml.safe_load(path.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ParametersError(f"{path} cannot be read: {' '.join(str(error).split())}") from None
    if not isinstance(said, dict):
        raise ParametersError(f"{path} holds no ROS parameters, expected names of nodes")
    try:
        policy_given = _given(said, "policy_node", PolicyParameters())
        lidar_given = _given(said, "lidar_collision_node", LidarParameters())
        if policy_given is None and lidar_given is None:
            raise ValueError(
                "it has no parameters of policy_node or lidar_collision_node; expected those of "
                "at least one"
            )
        policy_given, lidar_given = policy_given or {}, lidar_given or {}
        return RobotParameters(
            policy=settled(PolicyParameters(), policy_given),
            lidar=settled(LidarParameters(), lidar_given),
            mount_given=any(name in lidar_given for name in MOUNT),
            image_topic=policy_given.get("image_topic", ""),
        )
    except ValueError as error:
        raise ParametersError(f"{path}: {error}") from None


def _given(said: Mapping[Any, Any], node: str, defaults: object) -> dict[str, Any] | None:
    """The parameters of a node by dotted name, None when nothing is said of it.

    What holds for every node need not be known by this one.
    """
    own = [name for name in said if str(name).rpartition("/")[2] == node]
    if len(own) > 1:
        raise ValueError(
            f"it has parameters of {len(own)} nodes ({', '.join(own)}); expected one of them: give "
            "a file for each robot"
        )
    known = dict(leaves(defaults))
    shared = _flat(_below(said, EVERY_NODE)) if EVERY_NODE in said else ()
    found = {name: value for name, value in shared if name in known}
    for name, value in _flat(_below(said, own[0])) if own else ():
        if name.split(".")[0] not in OF_RCLPY:
            found[name] = value
    return found if own or found else None


def _below(said: Mapping[Any, Any], name: str) -> Mapping[Any, Any]:
    inner = said[name]
    found = inner.get(BELOW) if isinstance(inner, dict) else None
    if not isinstance(found, dict):
        raise ValueError(f"{name} has no {BELOW} below it")
    return found


def _flat(values: Mapping[Any, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value
