"""Events as a real bag: what a robot or a simulator with these topics would have recorded."""

from pathlib import Path

import numpy as np
from cfnav_ros.bags.files.events import (
    Bumps,
    Decided,
    Event,
    Joint,
    LaserTurn,
    Picture,
    Pose,
    Tick,
    Told,
    Truth,
    Velocity,
)

from studies.bags import bag_files as b


def bag_of(path: Path, events: list[Event]) -> Path:
    """Write the events under their log times; kinds that no test needs are not known."""
    return b.write(path, messages_of(events))


def messages_of(events: list[Event], namespace: str = "") -> list[b.Message]:
    """The messages of a robot in a namespace, such as ``/r1``."""
    said = [(event.log_ns, *_MESSAGES[type(event)](event)) for event in events]
    return [b.Message(namespace + name, m.__msgtype__, log_ns, m) for log_ns, name, m in said]


def _picture(e: Picture):
    rgb = e.decode()
    side = len(rgb)
    return "/image_raw", b.make(
        "sensor_msgs/msg/Image", header=b.header(e.t_ns, "camera"), height=side, width=side,
        encoding="rgb8", is_bigendian=0, step=3 * side, data=rgb.ravel(),
    )  # fmt: skip


def _turn(e: LaserTurn):
    s = e.scan
    return "/scan", b.make(
        "sensor_msgs/msg/LaserScan", header=b.header(e.t_ns, s.frame), angle_min=s.angle_min,
        angle_max=s.angle_max, angle_increment=s.angle_increment, time_increment=0.0,
        scan_time=s.scan_time, range_min=s.range_min, range_max=s.range_max,
        ranges=np.asarray(s.ranges, np.float32), intensities=np.zeros(0, np.float32),
    )  # fmt: skip


def _pose(e: Pose):
    message = b.odometry(e.t_ns, e.x, e.yaw, e.v)
    message.pose.pose.position.y = e.y
    message.twist.twist.angular.z = e.w
    return "/odom", message


def _told(e: Told):
    return "/policy/episode", b.make(
        "cfnav_interfaces/msg/EpisodeStatus", header=b.header(e.t_ns), phase=int(not e.started),
        goal=e.goal, bundle=e.bundle, outcome=e.outcome, message=e.message, steps=0,
        path_length=0.0, vetoes=0, bumps=0,
    )  # fmt: skip


def _decided(e: Decided):
    return "/policy/decision", b.make(
        "cfnav_interfaces/msg/PolicyDecision", header=b.header(e.t_ns), goal=e.goal, step=e.step,
        image_stamp=b.stamp(e.image_ns), estimate_stamp=b.stamp(e.estimate_ns), action=e.action,
        action_probabilities=e.probabilities, collision_probability=e.collision_probability,
        detection_score=e.detection_score, vetoed=e.vetoed, met_before=e.met_before,
        by_detections=e.by_detections,
    )  # fmt: skip


def _truth(e: Truth):
    message = b.truth(e.t_ns, e.x)
    message.goal, message.collisions, message.goal_visible = e.goal, e.collisions, e.goal_visible
    return "/ground_truth/state", message


def _tick(e: Tick):
    return "/clock", b.make("rosgraph_msgs/msg/Clock", clock=b.stamp(e.t_ns))


_MESSAGES = {
    Picture: _picture,
    LaserTurn: _turn,
    Pose: _pose,
    Told: _told,
    Decided: _decided,
    Truth: _truth,
    Tick: _tick,
    Joint: lambda e: ("/joint_states", b.joints(e.t_ns, e.angle)),
    Bumps: lambda e: ("/hazard_detection", b.hazards(e.t_ns, *e.zones)),
    Velocity: lambda e: ("/cmd_vel", b.command(e.t_ns, e.v)),
}
