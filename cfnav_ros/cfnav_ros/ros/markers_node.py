"""What the policy decides and the LiDAR concludes, as markers that RViz can show.

RViz has no display for cfnav's own messages. ``robot.launch.py rviz:=true`` starts this node; it
only listens, and nothing depends on it. Run it with ``cfnav node markers``.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

from cfnav_interfaces.msg import CollisionEstimate, EpisodeStatus, PolicyDecision
from geometry_msgs.msg import Point, Pose, Vector3
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from cfnav_core.robot.robot import Robot, robot_setting
from cfnav_core.robot.settings import setting
from cfnav_core.robot.topics import TOPICS
from cfnav_core.task.actions import STEP_M, Action
from cfnav_ros.lidar.estimate import Verdict
from cfnav_ros.ros.node_process import run_node
from cfnav_ros.ros.parameters import declare, named_robot
from cfnav_ros.ros.topics import publisher, quality

SHOWN_M = 1.5
"""Longest clearance that is drawn."""


@dataclass(frozen=True)
class MarkersParameters:
    """Parameters of ``markers_node``; the frame is that of the estimates."""

    robot: str = robot_setting()
    radius: float = setting(Robot.radius, "disc.radius of the LiDAR node, m", 0.05, 1.0)


class MarkersNode(Node):
    """Draws the way ahead in the colour of its collision probability, and a line of text."""

    def __init__(self) -> None:
        super().__init__("markers_node", automatically_declare_parameters_from_overrides=True)
        hull = MarkersParameters(radius=named_robot(self).radius)
        self._radius = declare(self, hull).radius
        self._decision = "no decision yet"
        self._markers = publisher(self, TOPICS["markers"])
        newest, episode = qos_profile_sensor_data, quality(TOPICS["episode"], 1)
        for kind, role, act, qos in (
            (CollisionEstimate, "estimate", self._on_estimate, newest),
            (PolicyDecision, "decision", self._on_decision, 5),
            (EpisodeStatus, "episode", self._on_episode, episode),
        ):
            self.create_subscription(kind, TOPICS[role].name, act, qos)

    def _on_decision(self, message: PolicyDecision) -> None:
        veto = ", vetoed" if message.vetoed else ""
        self._decision = (
            f"{message.goal} {message.detection_score:.2f}, step {message.step}: "
            f"{Action(message.action).name}{veto}"
        )

    def _on_episode(self, message: EpisodeStatus) -> None:
        ended = message.phase == EpisodeStatus.ENDED
        self._decision = f"{message.goal}: {message.outcome if ended else 'begins'}"

    def _on_estimate(self, estimate: CollisionEstimate) -> None:
        verdict = Verdict(estimate.verdict).name
        said = f"p {estimate.probability:.2f}, {estimate.clearance:.2f} m free, {verdict}"
        markers = [way_ahead(estimate, self._radius), text(estimate, f"{self._decision}\n{said}")]
        self._markers.publish(MarkerArray(markers=markers))


def way_ahead(estimate: CollisionEstimate, radius: float) -> Marker:
    """The strip that a hull of this radius, m, can advance over.

    A blind LiDAR's is one step long and red.
    """
    blind = estimate.verdict == CollisionEstimate.BLIND
    length = STEP_M if blind else max(min(estimate.clearance, SHOWN_M), 0.01)
    marker = _marker(estimate, 0, Marker.CUBE)
    marker.pose = Pose(position=Point(x=radius + length / 2, z=0.01))
    marker.scale = Vector3(x=length, y=2 * radius, z=0.01)
    p = estimate.probability
    marker.color = ColorRGBA(r=p, g=1.0 - p, a=0.6)
    return marker


def text(estimate: CollisionEstimate, said: str) -> Marker:
    """Words beside the robot."""
    marker = _marker(estimate, 1, Marker.TEXT_VIEW_FACING)
    marker.pose = Pose(position=Point(x=-0.5, z=0.5))
    marker.scale = Vector3(z=0.1)
    marker.color = ColorRGBA(r=1.0, g=1.0, b=1.0, a=1.0)
    marker.text = said
    return marker


def _marker(estimate: CollisionEstimate, number: int, kind: int) -> Marker:
    # Stamped 0: at the newest pose, as RViz may not have heard the one of the scan yet.
    marker = Marker(ns="policy", id=number, type=kind, frame_locked=True)
    marker.header.frame_id = estimate.header.frame_id
    return marker


def main(args: list[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM; the exit code is that of ``run_node``."""
    return run_node("markers_node", MarkersNode, args)


if __name__ == "__main__":
    sys.exit(main())
