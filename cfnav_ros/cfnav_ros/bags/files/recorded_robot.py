"""Which robot drove, and what its nodes were told: in ``custom_data`` of a bag's metadata."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from cfnav_core.robot.robot import Robot, load_robot, parse_robot
from cfnav_ros.bags.files.reading import Bag

NAME, FILE, PARAMETERS = "cfnav_robot", "cfnav_robot_file", "cfnav_parameters"
BELOW = "ros__parameters"
"""In a parameter file, between a node and its parameters."""


def said_of(robot: Robot) -> dict[str, str]:
    """What a bag says of the robot that drives."""
    return {NAME: robot.name, FILE: robot.said}


def told_of(parameters: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """What a bag says of the parameters of nodes: a parameter file.

    Args:
        parameters: values by node and dotted name.
    """
    file = {node: {BELOW: dict(values)} for node, values in parameters.items()}
    return {PARAMETERS: yaml.safe_dump(file)} if file else {}


def recorded_parameters(bag: Path) -> str:
    """The parameter file in a bag; empty when it has none, as those of other recorders."""
    return Bag(bag).custom.get(PARAMETERS, "")


def recorded_robot(bag: Bag | Path) -> Robot | None:
    """The robot that drove; None when the bag does not say, as those of other recorders.

    Raises:
        ValueError: its file is of no use, as that of a newer cfnav; one sentence.
    """
    said = bag.custom if isinstance(bag, Bag) else Bag(bag).custom
    if NAME not in said:
        return None
    try:
        return parse_robot(said[NAME], said.get(FILE, ""))
    except ValueError as error:
        raise ValueError(
            f"{bag.path if isinstance(bag, Bag) else bag} was recorded on the robot {said[NAME]}, "
            f"whose file in the bag is of no use ({error}); name a robot by --robot"
        ) from None


def robot_for(bag: Bag | Path, given: str) -> Robot:
    """The robot that is named, else the one that drove, else ``DEFAULT``.

    Raises:
        ValueError: there is none of this name, or a file is of no use; one sentence.
    """
    return load_robot(given) if given else recorded_robot(bag) or load_robot()
