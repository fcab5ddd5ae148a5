"""A robot and its ROS parameter file -> how its nodes judged and decided. Needs no ROS.

Such as those of cfnav_bringup: node names, also with ``/**``, above ``ros__parameters``. Other
nodes in the file are of no concern here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import yaml

from cfnav_core.robot.robot import Robot, UnknownRobotError, load_robot
from cfnav_core.robot.settings import flat, leaves, settled
from cfnav_ros.bags.files.recorded_robot import BELOW, recorded_parameters, recorded_robot
from cfnav_ros.drive.policy_parameters import PolicyParameters
from cfnav_ros.lidar.mounting import MOUNT
from cfnav_ros.lidar.scan_watch import LidarParameters

T = TypeVar("T")

EVERY_NODE = "/**"

JUDGES = {
    "policy_node": ("bundle", "room_type", "tilt_joint", "detections", "episode"),
    "lidar_collision_node": (
        "stale", "stale_rate", "frozen", "mount", "base_frame", "frame", "disc", "errors",
    ),
}  # fmt: skip
"""Parameters by which a drive is judged, before their first dot. A bag says all that nodes were
told; what else it says may be of a newer cfnav, and is of no concern."""


class ParametersError(ValueError):
    """The file cannot be used; the text is one sentence."""


@dataclass(frozen=True)
class RobotParameters:
    """What a robot and a parameter file say of the two nodes.

    Attributes:
        robot: what it is.
        policy: of ``policy_node``.
        lidar: of ``lidar_collision_node``.
        mount_given: one of them says where the LiDAR sits.
    """

    robot: Robot
    policy: PolicyParameters
    lidar: LidarParameters
    mount_given: bool


def read_parameters(path: Path | None, robot: str = "", bag: Path | None = None) -> RobotParameters:
    """Read a robot and a parameter file.

    Args:
        path: of the parameter file, None for none.
        robot: name or file of the robot; that which the parameter file names when empty.
        bag: says both when neither is given. Where it does not, the robot is ``DEFAULT``.

    Raises:
        ParametersError: there is no such robot, or a file cannot be read, names neither node, or
            gives a node a parameter that it does not have or refuses; one sentence.
    """
    if robot:
        _check(robot)
    if path is not None:
        try:
            return _read(path.read_text(), robot, bag)
        except (OSError, UnicodeDecodeError) as error:
            raise ParametersError(f"{path} cannot be read: {error}") from None
        except ValueError as error:
            raise ParametersError(f"{path}: {' '.join(str(error).split())}") from None
    text = recorded_parameters(bag) if bag and not robot else ""
    if bag is None or not text:
        return _settled({}, {}, robot, bag)
    try:
        told = _read(text, "", bag, JUDGES)
    except ValueError as error:
        raise ParametersError(
            f"what the nodes of {bag} were told is of no use ({' '.join(str(error).split())}); "
            "name the robot, or give a parameter file"
        ) from None
    # of all that a node was told nobody knows what somebody gave it
    return replace(told, mount_given=recorded_robot(bag) is not None)


def _read(
    text: str, robot: str, bag: Path | None, judges: Mapping[str, Sequence[str]] | None = None
) -> RobotParameters:
    """What a parameter file says; of ``judges``, where given, and of nothing else."""
    try:
        said = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(f"it cannot be read: {error}") from None
    if not isinstance(said, dict):
        raise ValueError("it holds no ROS parameters, expected names of nodes")
    policy = _given(said, "policy_node", PolicyParameters())
    lidar = _given(said, "lidar_collision_node", LidarParameters())
    if policy is None and lidar is None:
        raise ValueError(
            "it has no parameters of policy_node or lidar_collision_node; expected those of "
            "at least one"
        )
    given = {"policy_node": policy or {}, "lidar_collision_node": lidar or {}}
    for node, names in (judges or {}).items():
        told = given[node].items()
        given[node] = {name: v for name, v in told if name.partition(".")[0] in names}
    return _settled(given["policy_node"], given["lidar_collision_node"], robot, bag)


def _check(robot: str) -> None:
    """Tell a robot that is not known from one of the robots in a bag."""
    try:
        load_robot(robot)
    except UnknownRobotError as error:
        hint = "to choose one of the robots in a bag, use --namespace."
        raise ParametersError(f"{str(error).rstrip('.')}; {hint}") from None
    except ValueError as error:
        raise ParametersError(str(error)) from None


def _settled(
    policy: dict[str, Any], lidar: dict[str, Any], robot: str, bag: Path | None
) -> RobotParameters:
    named = {robot} if robot else {str(g["robot"]) for g in (policy, lidar) if "robot" in g}
    if len(named) > 1:
        raise ValueError(f"it names two robots ({', '.join(sorted(named))}); expected one")
    recorded = None if named or bag is None else recorded_robot(bag)
    described = load_robot(*named) if named else recorded or load_robot()
    return RobotParameters(
        robot=described,
        policy=settled(PolicyParameters.of(described), policy),
        lidar=settled(LidarParameters.of(described), lidar),
        mount_given=bool(named or recorded) or any(name in lidar for name in MOUNT),
    )


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
    shared = flat(_below(said, EVERY_NODE)) if EVERY_NODE in said else ()
    found = {name: value for name, value in shared if name in known}
    if own:
        found |= flat(_below(said, own[0]))
    return found if own or found else None


def _below(said: Mapping[Any, Any], name: str) -> Mapping[Any, Any]:
    inner = said[name]
    found = inner.get(BELOW) if isinstance(inner, dict) else None
    if not isinstance(found, dict):
        raise ValueError(f"{name} has no {BELOW} below it")
    return found
