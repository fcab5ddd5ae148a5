"""The table of nodes: what a graph is started from, in which order, and what each node is told.

Launch files, bringup and ``RosGraph`` read it. Knows no ROS.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

SHARED = ("robot", "use_sim_time")


@dataclass(frozen=True)
class NodeKind:
    """A node.

    Attributes:
        package: that brings it.
        takes: parameters that whoever starts it may give.
        ending: what its end means to the others under ``ros2 launch``.
    """

    package: str
    takes: tuple[str, ...]
    ending: Literal["all end", "it comes back", "nothing"] = "all end"


NODES: dict[str, NodeKind] = {
    "recorder_node": NodeKind("cfnav_ros", (*SHARED, "bag")),
    "mock_turtlebot4": NodeKind(
        "sim_bridge",
        (
            "robot", "room", "seed", "speed", "faults", "camera", "visual_shift", "true_estimate",
            "lock_step", "depth", "depth_down_deg", "detector", "detector_labels",
        ),
    ),
    "lidar_collision_node": NodeKind("cfnav_ros", SHARED, "it comes back"),
    "detector_node": NodeKind(
        "cfnav_ros", (*SHARED, "model", "labels", "lock_step"), "it comes back"
    ),
    "policy_node": NodeKind(
        "cfnav_ros",
        (
            *SHARED, "bundle", "room_type", "goal", "wait_for_recorder", "lock_step", "sample_seed",
            "other_camera", "detections.labels", "episode.veto", "episode.p_hat",
            "episode.command_lag",
        ),
    ),
    "markers_node": NodeKind("cfnav_ros", SHARED, "nothing"),
}  # fmt: skip
"""By executable, in the order in which they are started; they are ended in reverse."""


@dataclass(frozen=True)
class NodeStart:
    """A node to start, and what it is told."""

    package: str
    executable: str
    parameters: Mapping[str, object]

    @property
    def arguments(self) -> tuple[str, ...]:
        """The parameters as words after ``--ros-args``."""
        said = {n: str(v).lower() if isinstance(v, bool) else v for n, v in self.parameters.items()}
        return tuple(word for name, value in said.items() for word in ("-p", f"{name}:={value}"))


def parts(executables: Collection[str], given: Mapping[str, object]) -> list[NodeStart]:
    """The nodes of a graph in the order of their starts.

    Args:
        executables: that it has.
        given: parameters, of which each node is told those that it takes; None is not given.
    """
    told = {n: str(v) if isinstance(v, Path) else v for n, v in given.items() if v is not None}
    return [
        NodeStart(row.package, name, {n: told[n] for n in row.takes if n in told})
        for name, row in NODES.items()
        if name in executables
    ]
