"""How long the LiDAR node takes for a scan: ``python -m studies.deploy.scan_time``.

The real node in this process, its callback called with messages of noisy scans from real rooms,
timed from the message to the published estimate. Nothing else of ROS runs meanwhile.
"""

from __future__ import annotations

import os
import sys
import time
from array import array
from dataclasses import dataclass

import numpy as np
import rclpy
from cfnav_ros.lidar.estimate import Verdict
from cfnav_ros.ros.lidar_collision_node import LidarCollisionNode
from sensor_msgs.msg import LaserScan
from sim_bridge.robot.lidar_turn import standing_turn
from sim_bridge.robot.noise import Noise, NoiseLevels
from sim_bridge.room.room import generate_room
from sim_bridge.world.grid import state_grid
from sim_bridge.world.world import World

from cfnav_core.command import run_options
from cfnav_core.task.vocabulary import ROOM_TYPES
from studies.deploy.driven_moves import scan_of

LEAST_JUDGED = 0.8
"""Share of the scans that must be judged: a BLIND estimate costs less and would flatter the times.
"""

WARM_UP = 100
"""Scans before those that count: the first load code and fill caches."""


@dataclass(frozen=True)
class TimeConfig:
    """Time the LiDAR node's callback."""

    n: int = 5_000
    """Scans of 1080 ranges."""
    rooms: int = 8
    """From this many rooms, of all types, seeds 20 and up."""


def scans(config: TimeConfig) -> list[np.ndarray]:
    """Noisy ranges, float32 [1080] each, from every grid position's neighbourhood in turn."""
    each, found = -(-(config.n + WARM_UP) // config.rooms), []
    for k in range(config.rooms):
        world = World(generate_room(ROOM_TYPES[k % len(ROOM_TYPES)], 20 + k // len(ROOM_TYPES)))
        grid, rng = state_grid(world), np.random.default_rng(k)
        noise = Noise(NoiseLevels(), k)
        for state in rng.integers(len(grid.next_state), size=each):
            found.append(standing_turn(world, noise, pose=grid.pose(int(state))))
    return found


def message_of(ranges: np.ndarray, stamp: rclpy.time.Time) -> LaserScan:
    """The driver's message with these ranges."""
    scan = scan_of(ranges)
    message = LaserScan(range_min=scan.range_min, range_max=scan.range_max)
    message.header.stamp, message.header.frame_id = stamp.to_msg(), scan.frame
    message.angle_min, message.angle_max = scan.angle_min, scan.angle_max
    message.angle_increment = scan.angle_increment
    message.ranges = array("f", ranges.tobytes())
    return message


def measure(config: TimeConfig = TimeConfig()) -> dict[str, float]:
    """Milliseconds from message to published estimate, and the machine's load.

    Raises:
        RuntimeError: too many of the estimates were BLIND.

    Returns:
        p50, p99, max by the wall clock; p50_cpu, p99_cpu of the processor's time alone, which other
        programs on the machine lengthen less; n scans; judged, the share of them that was not
        BLIND; load, the mean of the last minute.
    """
    ranges = scans(config)
    context_is_ours = not rclpy.ok()
    if context_is_ours:
        rclpy.init(args=[])
    node = LidarCollisionNode()
    took, worked, judged = [], [], []
    try:
        for values in ranges:
            message = message_of(values, node.get_clock().now())
            begun, begun_work = time.perf_counter(), time.thread_time()
            node._on_scan(message)
            worked.append(time.thread_time() - begun_work)
            took.append(time.perf_counter() - begun)
            judged.append(node._last.verdict is not Verdict.BLIND)
    finally:
        node.destroy_node()
        if context_is_ours:
            rclpy.try_shutdown()
    share = float(np.mean(judged[WARM_UP : WARM_UP + config.n]))
    if share < LEAST_JUDGED:
        raise RuntimeError(
            f"{share:.0%} of the scans were judged, expected at least {LEAST_JUDGED:.0%}; the last "
            f"estimate says: {node._last.reason or 'nothing'}"
        )
    ms, cpu = (np.array(part[WARM_UP : WARM_UP + config.n]) * 1e3 for part in (took, worked))
    return {
        "p50": float(np.percentile(ms, 50)),
        "p99": float(np.percentile(ms, 99)),
        "max": float(ms.max()),
        "p50_cpu": float(np.percentile(cpu, 50)),
        "p99_cpu": float(np.percentile(cpu, 99)),
        "n": len(ms),
        "judged": share,
        "load": os.getloadavg()[0],
    }


def main(config: TimeConfig) -> None:
    """Measure and print."""
    for name, value in measure(config).items():
        print(f"{name}: {value:.3f}")


if __name__ == "__main__":
    sys.exit(run_options("scan_time", TimeConfig, main))
