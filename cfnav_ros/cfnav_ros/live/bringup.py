"""The nodes of a robot or of a simulation without ``ros2 launch``.

    cfnav robot --robot turtlebot4_mast --goal Laptop
    cfnav simulate --room kitchen:25

Starts the same graph as the launch files of ``cfnav_bringup``, shows what the nodes say, and ends
all of them when one ends or on Ctrl-C: the policy node first, so that the robot's last command is
zero. Knows no ROS.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from cfnav_core.command import ending, need, read_options
from cfnav_core.command.interrupt import INTERRUPT
from cfnav_core.policy.bundle import BundleHead, bundle_elsewhere, find_bundle
from cfnav_core.robot.robot import DEFAULT
from cfnav_ros.process.nodes import NodeStart, parts
from cfnav_ros.process.parameter_file import parameter_file
from cfnav_ros.process.processes import Child, GraphError, keep_local, node_command

LOOK_S = 0.2
"""Between looks at the processes and their logs."""


@dataclass(frozen=True, kw_only=True)
class Bringup:
    """What robot and simulation have in common."""

    robot: str
    """The name of a robot that is shipped, such as turtlebot4_mast, or its file."""
    params: str
    """Parameter file: a path, or the name of one that cfnav_bringup brings."""
    goal: str = ""
    """Sought from the start; without one the node waits for navigate_to_object."""
    namespace: str = ""
    """Of the robot, such as robot1."""
    bundle: Path | None = None
    """Bundle that drives, a folder or the name of a shipped one; that of the parameter file, or
    the robot's, when absent."""
    bag: Path | None = None
    """Record the drive into this folder."""
    logs: Path = Path("out/bringup")
    """Folder for the log of each process."""

    def run_command(self) -> None:
        """Start everything and show what it says, until Ctrl-C.

        Raises:
            GraphError: a node ended or could not run.
            ModuleNotFoundError: there is no ROS.
        """
        need("rclpy")  # here, not in the log of a node
        environment = dict(os.environ)
        try:
            common = common_arguments(self)
            if isinstance(self, SimulationBringup):
                keep_local(environment, self.logs)
            elif warning := unreachable(environment):
                print(f"bringup: {warning}", file=sys.stderr)
            print(f"bringup: parameters of {common[-1]}, logs in {self.logs}", flush=True)
            run(parts_of(self), common, environment, self.logs)
        except KeyboardInterrupt:
            print("bringup: interrupted; every process was ended", flush=True)


@dataclass(frozen=True, kw_only=True)
class RobotBringup(Bringup):
    """Drive a robot that is up: the LiDAR collision node and the policy node.

    ROS_DOMAIN_ID and the discovery settings stay those of the shell.
    """

    params: str = "robot.yaml"
    """Parameter file: a path, or the name of one that cfnav_bringup brings."""
    detector: Path | None = None
    """ONNX file of a detector to run on the robot's pictures, for a bundle that reads one."""
    labels: str = ""
    """What it learnt: coco, coco_ids, voc, objects365, open_images or a file; when absent as its
    file says, and coco for the policy."""


@dataclass(frozen=True, kw_only=True)
class SimulationBringup(Bringup):
    """Drive the mock TurtleBot 4 on this machine; nothing of it reaches another one."""

    robot: str = DEFAULT
    """As for a robot; the mock plays it."""
    params: str = "simulation.yaml"
    """Parameter file, as for a robot."""
    room: str = ""
    """<type>:<seed>, such as kitchen:25; seeds 20 to 29 were never trained on."""
    seed: int | None = None
    """Draws the start pose."""
    speed: float | None = None
    """Simulated seconds per second; 0 is as fast as the machine can."""
    faults: Path | None = None
    """Schedule of faults."""


def parts_of(config: Bringup) -> list[NodeStart]:
    """Return what to start, in the order in which it is ended in reverse.

    Raises:
        BundleError: there is no such bundle.
        GraphError: a detector that nobody would hear, or labels of none.
    """
    given: dict[str, object] = {
        "robot": config.robot,
        "goal": config.goal or None,
        "bundle": config.bundle and bundle_elsewhere(config.bundle),
        "bag": config.bag and config.bag.resolve(),
        "wait_for_recorder": config.bag and True,
    }
    nodes = ["lidar_collision_node", "policy_node", *["recorder_node"] * bool(config.bag)]
    if isinstance(config, RobotBringup):
        nodes += ["detector_node"] * bool(config.detector)
        given |= _detector(config)
    if isinstance(config, SimulationBringup):
        nodes.append("mock_turtlebot4")
        given |= {"room": config.room or None, "seed": config.seed, "speed": config.speed}
        given |= {"faults": config.faults and config.faults.resolve(), "use_sim_time": True}
    return parts(nodes, given)


def _detector(config: RobotBringup) -> dict[str, object]:
    """What the detector, and the policy that hears it, are told."""
    if config.detector is None and config.labels:
        raise GraphError(
            "found --labels without --detector; give the detector, or say detections.labels in the "
            "parameter file"
        )
    if config.detector is None:
        return {}
    if config.bundle and not BundleHead.load(find_bundle(config.bundle)).reads_sightings:
        raise GraphError(
            f"found --detector for the bundle {config.bundle}, which sees pictures itself; leave "
            "it out, or name a bundle that reads one, such as boxes"
        )
    labels = config.labels or None
    return {"model": config.detector.resolve(), "labels": labels, "detections.labels": labels}


def common_arguments(config: Bringup) -> list[str]:
    """Return what every node gets after ``--ros-args`` before its own.

    Raises:
        GraphError: there is no such parameter file.
    """
    space = ["-r", f"__ns:=/{config.namespace.strip('/')}"] if config.namespace else []
    return [*space, "--params-file", str(parameter_file(config.params))]


def unreachable(environment: Mapping[str, str]) -> str:
    """Return a sentence when these settings let no robot beyond this machine be seen."""
    found = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    if found not in ("LOCALHOST", "OFF") or environment.get("ROS_STATIC_PEERS"):
        return ""
    return (
        f"ROS_AUTOMATIC_DISCOVERY_RANGE is {found}: only a robot whose nodes run on this machine "
        "is seen; `export ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET` for one on the network."
    )


def run(
    parts: Sequence[NodeStart], common: Sequence[str], environment: Mapping[str, str], logs: Path
) -> None:
    """Start the parts and show what they say until one ends.

    Args:
        parts: ended in the reverse order.
        common: arguments of each before its own.
        environment: of every process.
        logs: folder for the log of each.

    Raises:
        GraphError: one ended; the others were ended too.
        KeyboardInterrupt: told to end; all were ended.
    """
    logs.mkdir(parents=True, exist_ok=True)
    children: list[Child] = []
    tails: list[Tail] = []
    try:
        for part in parts:
            command = [*node_command(part.package, part.executable), "--ros-args"]
            command += [*common, *part.arguments]
            log = logs / f"{part.executable}.log"
            children.append(Child(part.executable, command, log, environment))
            tails.append(Tail(part.executable, log))
        while True:
            INTERRUPT.check()
            _show(tails)
            for child in children:
                if sentence := child.ended():
                    raise GraphError(sentence)
            time.sleep(LOOK_S)
    finally:
        for child in reversed(children):
            child.stop()
        _show(tails)


class Tail:
    """What is new at the end of a growing log."""

    def __init__(self, name: str, log: Path) -> None:
        """Read from the beginning; ``name`` goes before each line."""
        self._name = name
        self._log = log
        self._read = 0

    def lines(self) -> list[str]:
        """Return the whole lines that came since the last call."""
        with self._log.open("rb") as file:
            file.seek(self._read)
            new = file.read()
        whole = new[: new.rfind(b"\n") + 1]
        self._read += len(whole)
        return [f"{self._name}: {line}" for line in whole.decode(errors="replace").splitlines()]


def parse(arguments: Sequence[str]) -> RobotBringup | SimulationBringup:
    """Read a command line; one that makes no sense ends the process as tyro does."""
    robot = Annotated[RobotBringup, tyro.conf.subcommand("robot")]
    simulation = Annotated[SimulationBringup, tyro.conf.subcommand("simulation")]
    asked: RobotBringup | SimulationBringup = read_options("bringup", robot | simulation, arguments)
    return asked


def main() -> int:
    """Entry point of ``ros2 run cfnav_ros bringup``; the exit code is ``ending``'s."""
    return ending("bringup", lambda: parse(sys.argv[1:]).run_command())


def _show(tails: Sequence[Tail]) -> None:
    for tail in tails:
        for line in tail.lines():
            print(line, flush=True)
