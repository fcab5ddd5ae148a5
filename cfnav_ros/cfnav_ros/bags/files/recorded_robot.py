"""Which robot drove, as a bag says it: in ``custom_data`` of its metadata, name and file."""

from __future__ import annotations

from pathlib import Path

from cfnav_core.robot.robot import Robot, load_robot, parse_robot
from cfnav_ros.bags.files.reading import Bag

NAME, FILE = "cfnav_robot", "cfnav_robot_file"


def said_of(robot: Robot) -> dict[str, str]:
    """What a bag says of the robot that drives."""
    return {NAME: robot.name, FILE: robot.said}


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
