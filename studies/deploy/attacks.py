"""Strangers who speak as the robot's own nodes do: ``python -m studies.deploy.attacks``.

A robot that always wants to drive on stands 0.40 m before a wall, so that its second MoveAhead
would touch it, and all that keeps it off is what it believes. Once it drives, a node in a
participant of its own says what would make it go on. Told are contacts by the simulator's truth,
how long the robot moved on, and when and why its goal ended.
"""

from __future__ import annotations

import json
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

from cfnav_interfaces.msg import CollisionEstimate
from cfnav_ros.process.processes import GraphError
from cfnav_ros.ros.conversions import ns_to_stamp
from cfnav_ros.ros.spinning import SpinningThread, join, leave
from geometry_msgs.msg import TransformStamped, TwistStamped
from irobot_create_msgs.msg import HazardDetectionVector
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Image, LaserScan
from tf2_msgs.msg import TFMessage
from tqdm import tqdm

from cfnav_core.command import run_options
from cfnav_core.files.provenance import commit
from cfnav_core.task.actions import Action
from studies.deploy.bundles import make_bundle
from studies.deploy.places import ROOM, StartPlaces
from studies.deploy.pool import results
from studies.deploy.rig import Rig

GOAL = "Laptop"
WATCH_S = 15.0
"""How long the robot is watched after the first forged message, s: four motions and more."""
BEGIN_S = 20.0
GONE_S = 60.0
"""How long a hung node stays in the graph at most, s: its lease is 20 s."""
JOIN_S = 0.5
"""How long one that leaves at once waits for somebody to listen, s."""
STILL_S = 3.0
"""One that stood for so long has given up, s."""
STANDING = 0.005
"""m/s below which it stands."""

Forgery = Callable[[Any], Any]
"""Makes a message that is stamped with the given moment."""


def _estimate(stamp: Any) -> CollisionEstimate:
    message = CollisionEstimate(probability=0.0, clearance=9.0, known_fraction=1.0)
    message.header.stamp = stamp
    return message


def _odometry(stamp: Any) -> Odometry:
    """It stands where it was switched on."""
    message = Odometry()
    message.header.stamp, message.pose.pose.orientation.w = stamp, 1.0
    return message


def _scan(stamp: Any) -> LaserScan:
    """Nothing within 5 m."""
    message = LaserScan(angle_min=-3.124, angle_max=3.142, range_min=0.15, range_max=12.0)
    message.ranges = [5.0] * 1080
    message.angle_increment = (message.angle_max - message.angle_min) / 1079
    message.header.stamp, message.header.frame_id = stamp, "rplidar_link"
    return message


def _picture(stamp: Any) -> Image:
    message = Image(height=300, width=300, encoding="bgr8", step=900, data=bytes(270_000))
    message.header.stamp = stamp
    return message


def _hazards(stamp: Any) -> HazardDetectionVector:
    """Nothing presses."""
    message = HazardDetectionVector()
    message.header.stamp = stamp
    return message


def _velocity(stamp: Any) -> TwistStamped:
    message = TwistStamped()
    message.header.stamp, message.twist.linear.x = stamp, 0.2
    return message


def _transforms(stamp: Any) -> TFMessage:
    """The LiDAR is turned by half a turn: what is ahead would be behind."""
    turned = TransformStamped(child_frame_id="rplidar_link")
    turned.header.stamp, turned.header.frame_id = stamp, "base_link"
    turned.transform.translation.x = -0.04
    turned.transform.rotation.z = -math.sqrt(0.5)
    turned.transform.rotation.w = math.sqrt(0.5)
    return TFMessage(transforms=[turned])


@dataclass(frozen=True)
class Attack:
    """What a stranger does.

    Attributes:
        words: for the table.
        topic: where it speaks.
        forge: what it says.
        hz: how often.
        node: the stranger's name.
        lidar_stopped: whether the LiDAR node is stopped (SIGSTOP) as it begins.
        leaves: whether it comes anew for each word and leaves at once.
        again: whether the goal is sent again once the node that hangs is gone from the graph and
            the stranger alone is left.
    """

    words: str
    topic: str
    forge: Forgery
    hz: float
    node: str = "stranger"
    lidar_stopped: bool = False
    leaves: bool = False
    again: bool = False


FREE = "says on collision/estimate that nothing is there"
ATTACKS = (
    *(Attack(f"{FREE}, {hz} Hz", "collision/estimate", _estimate, hz) for hz in (10, 50, 200)),
    Attack(f"{FREE}, 20 Hz, the LiDAR node hangs", "collision/estimate", _estimate, 20,
           lidar_stopped=True),
    Attack(f"{FREE}, 20 Hz, the LiDAR node hangs, and the goal is sent again when it is gone",
           "collision/estimate", _estimate, 20, lidar_stopped=True, again=True),
    Attack(f"{FREE}, and leaves at once, 10 Hz", "collision/estimate", _estimate, 10, leaves=True),
    Attack(f"{FREE}, and leaves at once, 10 Hz, the LiDAR node hangs", "collision/estimate",
           _estimate, 10, lidar_stopped=True, leaves=True),
    Attack("sends scans in which nothing is near, 8 Hz", "scan", _scan, 8),
    Attack("sends odometry that stands, 50 Hz", "odom", _odometry, 50),
    Attack("sends black pictures, 15 Hz", "oakd/rgb/preview/image_raw", _picture, 15),
    Attack("says that nothing presses the bumper, 50 Hz", "hazard_detection", _hazards, 50),
    Attack("says on tf_static that the LiDAR is turned by half a turn, 10 Hz", "tf_static",
           _transforms, 10),
    Attack("drives ahead, 20 Hz", "cmd_vel", _velocity, 20),
    Attack("drives ahead as a node named policy_node, 20 Hz", "cmd_vel", _velocity, 20,
           node="policy_node"),
)  # fmt: skip


class Stranger:
    """A node in a context of its own that repeats a forgery from now until ``end``."""

    def __init__(self, attack: Attack, rig: Rig) -> None:
        """Join the graph's domain and speak."""
        self._context = join(rig.graph.domain)
        self._node = Node(attack.node, context=self._context)
        example = attack.forge(ns_to_stamp(0))
        # What is latched reaches latched subscriptions and the others.
        quality = QoSProfile(depth=5, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        publisher: Publisher | None = None

        def speak() -> None:
            nonlocal publisher
            if publisher is None:
                publisher = self._node.create_publisher(type(example), attack.topic, quality)
            end = time.monotonic() + JOIN_S
            while attack.leaves and not heard(publisher) and time.monotonic() < end:
                time.sleep(0.0005)
            publisher.publish(attack.forge(ns_to_stamp(round(rig.now * 1e9))))
            if attack.leaves:
                self._node.destroy_publisher(publisher)
                publisher = None

        def heard(publisher: Publisher) -> bool:
            return bool(publisher.get_subscription_count())

        self._node.create_timer(1 / attack.hz, speak)
        self._thread = SpinningThread(self._node)
        self._thread.start()

    def end(self) -> None:
        """Leave the domain."""
        self._thread.end()
        leave(self._node)


def run_attack(rig: Rig, places: StartPlaces, task: tuple[int, int]) -> tuple[dict[str, Any], bool]:
    """Make one run of one attack: its index and the number of the run.

    Returns:
        Its row, and whether the graph must be started anew.

    Raises:
        GraphError: the robot did not begin to drive.
    """
    attack, number = ATTACKS[task[0]], task[1]
    rig.prepare(ROOM, places.walls[number % len(places.walls)], number)
    handle = rig.graph.send_goal(GOAL)
    result = handle.get_result_async()
    if not rig.watch(lambda: abs(rig.truth[-1].v) > 0.1, BEGIN_S):
        raise GraphError(f"{attack.words}: the robot did not drive")
    if attack.lidar_stopped:
        rig.signal("lidar_collision_node", signal.SIGSTOP)
    began, touched = rig.now, rig.truth[-1].collisions
    stranger = Stranger(attack, rig)
    ended: list[float] = []

    def over() -> bool:
        newest = rig.truth[-1]
        if result.done() and not ended:
            ended.append(rig.now)
        stood = newest.still_since and newest.t - newest.still_since > STILL_S
        return newest.t > began + WATCH_S or bool(ended and stood)

    try:
        rig.watch(over, 3 * WATCH_S)
        if attack.again:
            alone = partial(_alone, rig, attack.topic)
            if not rig.watch(alone, GONE_S):
                raise GraphError(f"{attack.words}: the node that hangs did not leave the graph")
            began = rig.now
            result, ended = rig.graph.send_goal(GOAL).get_result_async(), []
            rig.watch(over, 3 * WATCH_S)
    finally:
        stranger.end()
        if attack.lidar_stopped:
            rig.signal("lidar_collision_node", signal.SIGCONT)
    moved = [s.t for s in rig.truth if s.t > began and abs(s.v) > STANDING]
    answer = result.result().result if ended else None
    return {
        "attack": attack.words,
        "run": number,
        "contacts": rig.truth[-1].collisions - touched,
        "ended_s": round(ended[0] - began, 3) if ended else None,
        "moved_s": round(max(moved, default=began) - began, 3),
        "outcome": answer.outcome if answer else "drives on",
        "message": answer.message if answer else "",
    }, attack.again


def _alone(rig: Rig, topic: str) -> bool:
    """Whether the stranger is the only one that speaks."""
    return rig.graph.node.count_publishers(topic) == 1


@dataclass(frozen=True)
class AttackConfig:
    """Measure what becomes of a robot before a wall when a stranger speaks on its topics."""

    out: Path = Path("out/bench")
    """Folder of ``attacks.json``."""
    runs: int = field(default_factory=lambda: int(os.environ.get("RUNS", "5")))
    """Runs of each attack; the environment's RUNS when not given."""
    graphs: int = 2
    """Live graphs side by side."""


def measure(config: AttackConfig) -> list[dict[str, Any]]:
    """Make all runs, write ``attacks.json`` and return a row for each run.

    Raises:
        GraphError: a run did not come about.
    """
    bundle = make_bundle(config.out / "bundles", {GOAL: (Action.MoveAhead,)})
    tasks = [(attack, run) for run in range(config.runs) for attack in range(len(ATTACKS))]
    rows: list[dict[str, Any]] = []
    version = commit()
    found = results(run_attack, tasks, bundle, config.out / "logs", config.graphs)
    for row in tqdm(found, total=len(tasks), unit="run"):
        if isinstance(row, str):
            raise GraphError(row)
        rows.append({**row, "commit": version})
    (config.out / "attacks.json").write_text(json.dumps(rows, indent=1) + "\n")
    return rows


def table(rows: Sequence[dict[str, Any]]) -> str:
    """One Markdown line for each attack."""
    head = "| a stranger ... | runs | contacts | goal ended after, s | at rest after, s | why |"
    lines = [head, "|---" * 6 + "|"]
    for attack in ATTACKS:
        made = [row for row in rows if row["attack"] == attack.words]
        if not made:
            continue
        ended = [row["ended_s"] for row in made if row["ended_s"] is not None]
        ends = sorted({row["message"] or row["outcome"] for row in made})
        lines.append(
            f"| {attack.words} | {len(made)} | {sum(row['contacts'] for row in made)} "
            f"| {_times(ended)} | {_times([row['moved_s'] for row in made])} "
            f"| {' / '.join(ends)} |"
        )
    return "\n".join(lines) + "\n"


def _times(seconds: Sequence[float]) -> str:
    return f"{median(seconds):.2f}, at most {max(seconds):.2f}" if seconds else "never"


def main(config: AttackConfig) -> None:
    """Measure and print."""
    print(table(measure(config)))


if __name__ == "__main__":
    sys.exit(run_options("attacks", AttackConfig, main))
