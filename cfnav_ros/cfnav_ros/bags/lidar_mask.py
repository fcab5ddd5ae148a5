"""Where the LiDAR sees the robot itself: ``cfnav bag mask BAG``.

Reads scans from a bag recorded while the robot turned on the spot in open space, at least once
around, and prints the lines for the robot's file. What stays in place while everything else
turns can only be the robot. Needs no ROS.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from cfnav_core.command import run_options
from cfnav_core.robot.robot import Robot
from cfnav_ros.bags.files.events import LaserTurn, Pose
from cfnav_ros.bags.files.finding import BagError, find_bags
from cfnav_ros.bags.files.reading import Bag
from cfnav_ros.bags.files.recorded_robot import robot_for
from cfnav_ros.bags.files.roles import Roles, assign, names_of
from cfnav_ros.lidar.returns import Mount, Scan, beams, measured

BIN_DEG = 0.5
"""Width of the bearings that are counted; the A1 announces one each third of a degree, or each."""

MIN_SCANS = 40
"""About five seconds of the A1."""

MAX_SEEN = 0.05
"""Share of scans in which a hidden bearing may return something: ghosts at the edges of a post."""

MIN_WIDTH_DEG = 2.0
"""A narrower piece is a beam that happened to meet nothing; a post of 6 mm hides five degrees."""

MAX_WIDTH_DEG = 45.0
"""A wider piece without returns is no part of the robot but a fault."""


@dataclass(frozen=True)
class Sector:
    """A part of the robot as the LiDAR sees it: bearing from the front, left positive, degrees."""

    bearing: float
    half_width: float


def turned(yaws: np.ndarray) -> float:
    """How far the robot turned between its two most distant headings, radians.

    Args:
        yaws: float [N], radians, in order.
    """
    return float(np.ptp(np.unwrap(yaws))) if len(yaws) else 0.0


def own_sectors(scans: Sequence[Scan], turn: float, mount: Mount, radius: float) -> list[Sector]:
    """Find the bearings that return nothing, or something within the hull, throughout.

    Args:
        scans: recorded in open space while the robot turned.
        turn: how far it turned, radians.
        mount: of the LiDAR on the robot.
        radius: of the hull, metres.

    Returns:
        The sectors in the order of their bearings.

    Raises:
        ValueError: this recording cannot tell; one sentence.
    """
    if len(scans) < MIN_SCANS:
        raise ValueError(f"there are {len(scans)} scans, expected at least {MIN_SCANS}")
    if turn < math.tau:
        raise ValueError(
            f"the robot turned by {math.degrees(turn):.0f} degrees, expected at least 360: without "
            "a whole turn a dark corner of the room looks like a part of the robot"
        )
    sectors = [_sector(run) for run in _runs(_hidden(scans, mount, radius))]
    for sector in sectors:
        if 2 * sector.half_width > MAX_WIDTH_DEG:
            raise ValueError(
                f"{2 * sector.half_width:.0f} degrees around bearing {sector.bearing:.0f} never "
                "return anything: the LiDAR is covered or broken, or the space is too open"
            )
    return sorted(sectors, key=lambda sector: sector.bearing)


def read_turn(path: Path, robot: Robot) -> tuple[list[Scan], np.ndarray, tuple[str, ...]]:
    """Read what a bag holds of a turn.

    Args:
        path: one of those that ``find_bags`` gives.
        robot: whose topics they are.

    Returns:
        Its scans; the headings of its odometry, float64 [N], radians in [-pi, pi]; what could not
        be read, a sentence each.
    """
    scans, yaws = [], []
    with Bag(path) as bag:
        roles = assign(bag.topics, names_of(robot)).topics
        wanted = {role: roles[role] for role in ("scan", "odom") if role in roles}
        for event in bag.events(Roles(wanted)):
            if isinstance(event, LaserTurn):
                scans.append(event.scan)
            elif isinstance(event, Pose):
                yaws.append(event.yaw)
        return scans, np.array(yaws, np.float64), tuple(bag.notes)


def _only(path: Path) -> Path:
    """The bag in a folder, or BagError."""
    found = find_bags([path])
    if len(found) > 1:
        raise BagError(f"{path} holds {len(found)} bags; expected the one of the turn")
    return found[0]


def file_lines(sectors: Sequence[Sector]) -> str:
    """The lines for the robot's file.

    One half-width serves all: that of the widest sector and one return more.
    """
    bearings = " ".join(f"{sector.bearing:g}" for sector in sectors)
    width = max((sector.half_width for sector in sectors), default=0.0)
    return f'lidar:\n  mask_bearings_deg: "{bearings}"\n  mask_half_width_deg: {width + 1.0:.1f}'


def _hidden(scans: Sequence[Scan], mount: Mount, radius: float) -> np.ndarray:
    """Whether a bearing hardly ever returned anything beyond the hull: bool [360 / BIN_DEG].

    A bearing between two beams, at which nobody looked, is as the beam before it.
    """
    bins = round(360.0 / BIN_DEG)
    looked, seen = np.zeros(bins, int), np.zeros(bins, int)
    for scan in scans:
        ranges = np.asarray(scan.ranges, np.float64)
        there = beams(ranges.size, scan.angle_min, scan.angle_increment, mount, (), 0.0, radius)
        index = np.floor(np.degrees(there.bearing) % 360.0 / BIN_DEG).astype(int) % bins
        np.add.at(looked, index, 1)
        np.add.at(seen, index, measured(ranges, scan) & (ranges > there.hull))
    hidden = (looked > 0) & (seen <= MAX_SEEN * looked)
    # Twice around, so that the first bearings find their beam at the end of the circle.
    beam = np.where(np.tile(looked > 0, 2), np.arange(2 * bins), 0)
    return hidden[np.maximum.accumulate(beam)[bins:] % bins]


def _runs(hidden: np.ndarray) -> list[tuple[int, int]]:
    """First bin and number of bins of each run around the circle, MIN_WIDTH_DEG or longer."""
    if hidden.all():
        return [(0, hidden.size)]
    start = int(np.argmin(hidden))  # a bin that is no part of a run
    edges = np.diff(np.r_[0, np.roll(hidden, -start).astype(int), 0])
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    shortest = round(MIN_WIDTH_DEG / BIN_DEG)
    return [
        (int(b) + start, int(e - b)) for b, e in zip(begins, ends, strict=True) if e - b >= shortest
    ]


def _sector(run: tuple[int, int]) -> Sector:
    first, count = run
    bearing = (first + count / 2) * BIN_DEG
    return Sector((bearing + 180.0) % 360.0 - 180.0, count * BIN_DEG / 2)


@dataclass(frozen=True)
class LidarMask:
    """Print the LiDAR's mask as lines for the robot's file.

    The bag is of a robot that turned on the spot in open space, at least once around.
    """

    bag: Annotated[Path, tyro.conf.Positional]
    """Folder of a bag with scans and odometry."""
    robot: str = ""
    """Name of one that is shipped, or its file, when not given that which the bag says has turned,
    else turtlebot4_mast: where its LiDAR sits, and its hull; what returns from within that is the
    robot."""

    def run_command(self) -> None:
        """Learn and print.

        Raises:
            BagError: there is no such bag, or it cannot tell.
            ValueError: the robot's file does not say where its LiDAR sits.
        """
        bag = _only(self.bag)
        described = robot_for(bag, self.robot)
        lidar = described.lidar
        if lidar.mount == "tf":
            raise ValueError(
                f"lidar.mount of {described.name} is tf, expected the mount parameters with x, y "
                "and yaw_deg: say where its LiDAR sits to learn what it sees of itself."
            )
        mount = Mount(lidar.x, lidar.y, math.radians(lidar.yaw_deg))
        scans, yaws, notes = read_turn(bag, described)
        for note in notes:
            print(f"lidar_mask: {note}", file=sys.stderr)
        try:
            sectors = own_sectors(scans, turned(yaws), mount, described.radius)
        except ValueError as error:
            raise BagError(f"{self.bag}: {error}") from None
        print(file_lines(sectors))


def main() -> int:
    """Entry point of ``ros2 run cfnav_ros lidar_mask``; the exit code is ``ending``'s."""
    return run_options("lidar_mask", LidarMask)
