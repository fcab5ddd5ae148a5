"""Recorded drives in one line each: what a bag says, and how its drives went. Needs no ROS."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from cfnav_ros.bags.evaluation import EvaluatedDrive, JudgeOptions, evaluate
from cfnav_ros.bags.files.finding import find_bags, unique_names
from cfnav_ros.bags.files.parameters_file import read_parameters
from cfnav_ros.bags.files.reading import Bag as Bag
from cfnav_ros.bags.judge.episodes_file import read_episodes


def judge(
    path: Path | str,
    topics: Mapping[str, str] | None = None,
    episodes: Path | str | None = None,
    robot: Path | str = "",
) -> list[EvaluatedDrive]:
    """Judge every drive of a bag, or of all bags in a folder, from its start to its end.

    Args:
        path: a bag (its folder or a file of it), or a folder with bags.
        topics: names of topics by role, such as {"image": "/camera"}, where they are not the usual.
        episodes: YAML or CSV file of the drives that no policy node told of.
        robot: name of a shipped one, or its file, with what holds on it; when empty what a bag says
            has driven, and what its nodes were told.

    Raises:
        BagError: there is no bag.
        ValueError: the episodes file, or the robot, cannot be used.
    """
    rows = read_episodes(Path(episodes)) if episodes else ()
    bags, drives = find_bags([Path(path)]), list[EvaluatedDrive]()
    for bag, name in zip(bags, unique_names(bags), strict=True):
        told = read_parameters(None, str(robot), bag)
        options = JudgeOptions.of(told, topics or {}, rows=rows)
        drives += evaluate(bag, options, name=name).drives
    return drives
