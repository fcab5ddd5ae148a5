"""The ``cfnav`` command: what it can do, and where. Only what is asked for is loaded."""

from __future__ import annotations

import difflib
import sys
from importlib import import_module
from typing import Any, NamedTuple

from cfnav_core import __version__
from cfnav_core.command import COULD_NOT, DONE, ending, read_options


class Entry(NamedTuple):
    """A command: ``module:Options`` with ``run_command``, or ``module:main`` of a node."""

    where: str
    what: str


CHAPTERS: dict[str, dict[str, Entry]] = {
    "Rooms and data sets": {
        "rooms make": Entry(
            "sim_bridge.data.dataset:RoomOptions", "render rooms, to train or test in"
        ),
        "rooms scan": Entry("sim_bridge.data.scans:ScanOptions", "scan rooms with the LiDAR"),
        "rooms boxes": Entry(
            "sim_bridge.data.boxes:BoxOptions", "make scenes of a detector's boxes, to train in"
        ),
        "rooms overhangs": Entry(
            "sim_bridge.data.overhangs:OverhangOptions", "count collisions that no LiDAR foresees"
        ),
        "rooms goals": Entry(
            "sim_bridge.data.goals:GoalOptions", "count the goals that rooms offer to a camera"
        ),
        "rooms show": Entry("sim_bridge.data.room_sheet:ShowOptions", "draw rooms, to look at"),
        "rooms models": Entry(
            "sim_bridge.data.model_sheet:ModelOptions", "draw furniture models, to look at"
        ),
        "data info": Entry("cfnav.data_cli:InfoData", "list the scenes of a data set"),
        "data check": Entry("cfnav.data_cli:CheckData", "say what is damaged or missing in it"),
        "data convert": Entry("cfnav.data_cli:ConvertData", "make one store of a data set"),
        "data restamp": Entry("cfnav.restamp:RestampData", "take over rooms of an older version"),
        "data lidar": Entry(
            "cfnav_ros.lidar.states:EstimateOptions", "judge scans as the LiDAR node does"
        ),
        "data episodes": Entry("cfnav.data_cli:EpisodesData", "take over published start states"),
        "data freeze": Entry("cfnav.data_cli:FreezeData", "draw episodes once, for all tests"),
        "data knowledge": Entry(
            "cfnav_core.knowledge.command:KnowledgeCommand", "make what models know beforehand"
        ),
        "data words": Entry("cfnav_core.words.make:WordOptions", "make the table of word vectors"),
        "data features": Entry(
            "cfnav_core.published.features:FeaturesData", "make features of published pictures"
        ),
        "data export-ai2thor": Entry(
            "cfnav_core.published.ai2thor:ExportAi2thor", "take scenes from AI2-THOR"
        ),
    },
    "Learning": {
        "perception": Entry(
            "cfnav_core.perception.train:PerceptionOptions", "train the perception network"
        ),
        "perceive": Entry("cfnav.perceive:Perceive", "name what pictures show, with boxes"),
        "train": Entry("cfnav.policies:Train", "train a policy"),
        "evaluate": Entry("cfnav.policies:Evaluate", "test a policy on episodes, or compare two"),
        "export": Entry("cfnav.policies:Export", "make a bundle for the robot of a checkpoint"),
        "info": Entry("cfnav.policies:Info", "show the model card of a bundle"),
        "benchmark": Entry(
            "studies.paper.command:Benchmark", "make the paper's tables (in a checkout)"
        ),
    },
    "Driving": {
        "demo": Entry("cfnav_ros.live.demo:DemoConfig", "a simulated robot seeks objects"),
        "simulate": Entry(
            "cfnav_ros.live.bringup:SimulationBringup", "start a simulated robot's nodes"
        ),
        "robot": Entry(
            "cfnav_ros.live.bringup:RobotBringup", "start the nodes that drive a real robot"
        ),
        "bag eval": Entry("cfnav_ros.report.bag_eval:BagEvalConfig", "judge recorded drives"),
        "bag play": Entry("cfnav_ros.ros.bag_play:BagPlay", "play what the sensors said"),
        "bag mask": Entry(
            "cfnav_ros.bags.lidar_mask:LidarMask", "find where the LiDAR sees the robot"
        ),
    },
    "Single nodes, which take ROS arguments (--ros-args ...)": {
        "node policy": Entry("cfnav_ros.ros.policy_node:main", "decides and moves the base"),
        "node lidar": Entry("cfnav_ros.ros.lidar_collision_node:main", "judges scans"),
        "node recorder": Entry("cfnav_ros.ros.recorder_node:main", "records a drive"),
        "node detector": Entry("cfnav_ros.ros.detector_node:main", "finds things in pictures"),
        "node markers": Entry("cfnav_ros.ros.markers_node:main", "shows decisions in RViz"),
        "node mock": Entry("sim_bridge.ros.mock_turtlebot4:main", "is the simulated TurtleBot 4"),
    },
}
COMMANDS = {name: entry for chapter in CHAPTERS.values() for name, entry in chapter.items()}

INTRODUCTION = "Find a named object with one camera, touch nothing on the way."
END = """\
cfnav COMMAND --help says what a command takes, with all defaults.

Exit codes: 0 done; 1 done in part, or judged unfavourably; 2 could not; 130 told to stop."""


def main() -> int:
    """Do what the command line asks for; see ``cfnav_core.command`` for the exit code."""
    sys.argv[0], words = "cfnav", sys.argv[1:]
    name = next((n for n in (" ".join(words[:2]), *words[:1]) if n in COMMANDS), "")
    if not name:
        return _answer(words)
    return ending("cfnav", lambda: _run(name, words[len(name.split()) :]))


def _run(name: str, arguments: list[str]) -> int | None:
    module, _, attribute = COMMANDS[name].where.partition(":")
    found = import_module(module)
    target: Any = getattr(found, attribute)
    if isinstance(target, type):
        code: int | None = read_options(f"cfnav {name}", target, arguments).run_command()
        return code
    if {"-h", "--help"} & {*arguments}:
        print(found.__doc__)
        return DONE
    sys.argv[1:] = arguments  # where a node looks for them
    return int(target())


def _answer(words: list[str]) -> int:
    """Answer a command line that names no command: help, version, or what was meant."""
    if words == ["--version"]:
        print(f"cfnav {__version__}")
        return DONE
    groups = {name.partition(" ")[0] for name in COMMANDS if " " in name}
    named = [word for word in words if word not in ("-h", "--help")]
    if not named or (named == words[:1] and named[0] in groups):
        print(help_text(*named))
        return DONE
    name = " ".join(words[: 2 if words[0] in groups else 1])
    close = difflib.get_close_matches(name, [*COMMANDS, *groups], 1)
    meant = f" (did you mean {close[0]}?)" if close else ""
    print(f"cfnav: found command {name!r}{meant}, expected one that cfnav --help lists",
          file=sys.stderr)  # fmt: skip
    return COULD_NOT


def help_text(group: str = "") -> str:
    """The commands by chapter; those of one group when it is named."""
    parts = [f"usage: cfnav {group or 'COMMAND'} ...", INTRODUCTION]
    for title, chapter in CHAPTERS.items():
        rows = {n: e.what for n, e in chapter.items() if n.startswith(f"{group} ") or not group}
        if rows:
            parts.append("\n".join([f"{title}:", *(f"  {n:<22}{w}" for n, w in rows.items())]))
    return "\n\n".join([*parts, END])


if __name__ == "__main__":
    sys.exit(main())
