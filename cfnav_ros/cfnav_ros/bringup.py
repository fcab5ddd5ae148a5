"""The nodes of a robot or of a simulation without ``ros2 launch``.

    python -m cfnav_ros.bringup robot --params turtlebot4_stock.yaml --goal Laptop
    python -m cfnav_ros.bringup simulation --room kitchen:25

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

from cfnav_core.bundle import find_bundle
from cfnav_ros.processes import Child, GraphError, keep_local, node_command
from cfnav_ros.stop_signal import INTERRUPT

LOOK_S = 0.2
"""Between looks at the processes and their logs."""


@dataclass(frozen=True, kw_only=True)
class Drive:
    """What robot and simulation have in common."""

    goal: str = ""
    """Sought from the start; without one the node waits for navigate_to_object."""
    namespace: str = ""
    """Of the robot, such as robot1."""
    bundle: Path | None = None
    """Bundle that drives, a folder or the name of a shipped one; that of the parameter file, or
    the default, when absent."""
    bag: Path | None = None
    """Record the drive into this folder."""
    logs: Path = Path("out/bringup")
    """Folder for the log of each process."""


@dataclass(frozen=True, kw_only=True)
class Robot(Drive):
    """Drive a robot that is up: the LiDAR collision node and the policy node.

    ROS_DOMAIN_ID and the discovery settings stay those of the shell.
    """

    params: str
    """Parameter file: a path, or the name of one that cfnav_bringup brings, such as
    turtlebot4_stock.yaml."""


@dataclass(frozen=True, kw_only=True)
class Simulation(Drive):
    """Drive the mock TurtleBot 4 on this machine; nothing of it reaches another one."""

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


@dataclass(frozen=True)
class Part:
    """A node to start; ``arguments`` are those after ``--ros-args``."""

    package: str
    executable: str
    arguments: tuple[str, ...]


def parameter_file(given: str, environment: Mapping[str, str] = os.environ) -> Path:
    """Return a parameter file by its path or by its name in ``cfnav_bringup``.

    Raises:
        GraphError: there is no such file.
    """
    prefixes = [p for p in environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    folders = [Path(prefix) / "share/cfnav_bringup/config" for prefix in prefixes]
    for path in (Path(given), *(folder / given for folder in folders)):
        if path.is_file():
            return path.resolve()
    shipped = sorted({path.name for folder in folders for path in folder.glob("*.yaml")})
    known = f"one of {', '.join(shipped)}" if shipped else "a name that a built ros_ws brings"
    raise GraphError(f"--params is {given!r}, expected a file or {known}")


def parts(config: Robot | Simulation) -> list[Part]:
    """Return what to start, in the order in which it is ended in reverse.

    Raises:
        GraphError: there is no such parameter file.
    """
    space = f"/{config.namespace.strip('/')}" if config.namespace else ""
    common = ["-r", f"__ns:={space}"] if space else []
    common += ["--params-file", str(parameter_file(config.params))]
    bundle = find_bundle(config.bundle).resolve() if config.bundle else None
    recorded = "true" if config.bag else None
    chosen = _given(bundle=bundle, goal=config.goal or None, wait_for_recorder=recorded)
    policy = [*common, *chosen]
    made = [
        Part("cfnav_ros", "lidar_collision_node", tuple(common)),
        Part("cfnav_ros", "policy_node", tuple(policy)),
    ]
    if isinstance(config, Simulation):
        faults = config.faults.resolve() if config.faults else None
        chosen = _given(
            room=config.room or None, seed=config.seed, speed=config.speed, faults=faults
        )
        made.insert(0, Part("sim_bridge", "mock_turtlebot4", (*common, *chosen)))
    if config.bag is not None:
        simulated = str(isinstance(config, Simulation)).lower()
        chosen = _given(bag=config.bag.resolve(), use_sim_time=simulated)
        made.insert(0, Part("cfnav_ros", "recorder_node", (*common, *chosen)))
    return made


def unreachable(environment: Mapping[str, str]) -> str:
    """Return a sentence when these settings let no robot beyond this machine be seen."""
    found = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    if found not in ("LOCALHOST", "OFF") or environment.get("ROS_STATIC_PEERS"):
        return ""
    return (
        f"ROS_AUTOMATIC_DISCOVERY_RANGE is {found}: only a robot whose nodes run on this machine "
        "is seen; `export ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET` for one on the network."
    )


def run(parts: Sequence[Part], environment: Mapping[str, str], logs: Path) -> None:
    """Start the parts and show what they say until one ends.

    Args:
        parts: ended in the reverse order.
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
            command = [*node_command(part.package, part.executable), "--ros-args", *part.arguments]
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


def parse(arguments: Sequence[str]) -> Robot | Simulation:
    """Read a command line; one that makes no sense ends the process as tyro does."""
    robot = Annotated[Robot, tyro.conf.subcommand("robot")]
    simulation = Annotated[Simulation, tyro.conf.subcommand("simulation")]
    return tyro.cli(robot | simulation, prog="bringup", args=arguments)  # type: ignore[call-overload]


def main() -> None:
    """Run the command line: 0 on Ctrl-C, 1 with one sentence when a node ended or could not run."""
    config = parse(sys.argv[1:])
    environment = dict(os.environ)
    INTERRUPT.catch()
    try:
        started = parts(config)
        if isinstance(config, Simulation):
            keep_local(environment, config.logs)
        elif warning := unreachable(environment):
            print(f"bringup: {warning}", file=sys.stderr)
        print(f"bringup: logs in {config.logs}", flush=True)
        run(started, environment, config.logs)
    except KeyboardInterrupt:
        print("bringup: interrupted; every process was ended", flush=True)
    except (GraphError, OSError) as error:
        print(f"bringup: {error}", file=sys.stderr)
        sys.exit(1)


def _given(**values: object) -> list[str]:
    """Return parameters as arguments, without those that are None."""
    pairs = [("-p", f"{name}:={value}") for name, value in values.items() if value is not None]
    return [word for pair in pairs for word in pair]


def _show(tails: Sequence[Tail]) -> None:
    for tail in tails:
        for line in tail.lines():
            print(line, flush=True)


if __name__ == "__main__":
    main()
