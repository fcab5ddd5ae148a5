"""Fields of messages as the pure modules' types, the same for live and for recorded messages.

Pure: a message is anything with the fields of its type, whoever has deserialized it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfnav_core.perception.boxes import Box
from cfnav_core.task.pinhole import Pinhole
from cfnav_ros.drive.inputs import StampedEstimate, Tilt
from cfnav_ros.drive.motion import Odometry
from cfnav_ros.lidar.estimate import Estimate, Scan, Verdict

BUMP = 1
"""``HazardDetection.BUMP``."""


def stamp_to_ns(stamp: Any) -> int:
    """Nanoseconds of a builtin_interfaces/Time."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def stamp_to_seconds(stamp: Any) -> float:
    """Seconds of a builtin_interfaces/Time."""
    return stamp_to_ns(stamp) * 1e-9


def scan_from_message(message: Any) -> Scan:
    """A LaserScan's fields; whether they make sense is judged by ``lidar``."""
    return Scan(
        np.asarray(message.ranges, np.float32),
        message.angle_min,
        message.angle_max,
        message.angle_increment,
        message.range_min,
        message.range_max,
        message.header.frame_id,
        message.scan_time,
    )


def estimate_from_message(message: Any) -> StampedEstimate:
    """The estimate in a CollisionEstimate.

    Raises:
        ValueError: a verdict or a probability that does not exist; one sentence.
    """
    if not math.isfinite(message.clearance):
        raise ValueError("The collision estimate's clearance is not finite.")
    if not 0.0 <= message.probability <= 1.0:
        raise ValueError(f"The collision probability is {message.probability}, expected 0 to 1.")
    estimate = Estimate(
        message.probability,
        message.clearance,
        Verdict(message.verdict),
        message.reason,
        message.known_fraction,
    )
    return StampedEstimate(stamp_to_ns(message.header.stamp), estimate)


def yaw_of(q: Any, whose: str) -> float:
    """Heading of a geometry_msgs/Quaternion, radians counter-clockwise.

    Raises:
        ValueError: it has not the length 1.
    """
    norm = math.hypot(q.x, q.y, q.z, q.w)
    if not abs(norm - 1.0) < 0.01:
        raise ValueError(f"{whose} holds a quaternion of length {norm:g}, expected 1.")
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))


def odometry_from_message(message: Any) -> Odometry:
    """Planar pose and velocity of a nav_msgs/Odometry.

    Raises:
        ValueError: a value that is not finite, or no unit quaternion; one sentence.
    """
    pose, twist = message.pose.pose, message.twist.twist
    values = (pose.position.x, pose.position.y, twist.linear.x, twist.angular.z)
    if not all(map(math.isfinite, values)):
        raise ValueError("Odometry holds a value that is not finite.")
    yaw = yaw_of(pose.orientation, "Odometry")
    stamp = stamp_to_seconds(message.header.stamp)
    return Odometry(stamp, pose.position.x, pose.position.y, yaw, twist.linear.x, twist.angular.z)


def tilt_from_message(message: Any, joint: str) -> Tilt | None:
    """The camera's tilt in a JointState, None when the message speaks of other joints."""
    if joint not in message.name or len(message.position) != len(message.name):
        return None
    angle = float(message.position[message.name.index(joint)])
    if not math.isfinite(angle):
        return None
    return Tilt(stamp_to_seconds(message.header.stamp), angle)


def pinhole_from_message(message: Any) -> Pinhole:
    """What a CameraInfo says of the camera; whether its numbers make sense is judged by others."""
    fx, _, cx, _, fy, cy = (float(number) for number in message.k[:6])
    size = int(message.width), int(message.height)
    return Pinhole(fx, fy, cx, cy, *size, message.header.frame_id)


@dataclass(frozen=True)
class Claim:
    """What a detector says of one thing.

    Attributes:
        class_id: a number or a name, by its labels.
        score: 0..1.
        box: pixels of the picture that it was given.
        depth: of the thing along the camera's axis, metres; 0 where it says none.
        box_depth: the same of the middle of a box that has one; then the box may be in metres.
        frame: of the message.
    """

    class_id: str
    score: float
    box: Box
    depth: float = 0.0
    box_depth: float = 0.0
    frame: str = ""


MOST_DETECTIONS = 500
"""Of a message; depthai's detectors and TensorFlow's give 100 at most, others 300."""

FURTHEST_M = 50.0
"""Depth beyond which a message is of no room; depthai measures up to 10 m."""


def detections_from_message(message: Any) -> list[Claim]:
    """What a Detection2DArray or a Detection3DArray says.

    Boxes are in pixels, those of the second in metres along the camera's axes (right, down, ahead),
    as vision_msgs means them, or in pixels, too, as depthai_ros_driver fills them; the positions of
    its results tell how far things are. What has no name or no extent says nothing.

    Raises:
        ValueError: too many of them, or numbers that make no sense; one sentence.
    """
    if len(message.detections) > MOST_DETECTIONS:
        raise ValueError(
            f"A message holds {len(message.detections)} detections, expected {MOST_DETECTIONS} at "
            "most: raise the detector's least score."
        )
    told = []
    for one in message.detections:
        for result in one.results:
            if not 0.0 <= (score := result.hypothesis.score) <= 1.0:  # nan is neither
                raise ValueError(f"A detection's score is {score:g}, expected 0 to 1.")
        best = max(one.results, key=lambda result: result.hypothesis.score, default=None)
        if best is not None and (claim := _claim(one.bbox, best, message.header.frame_id)):
            told.append(claim)
    return told


def _claim(bbox: Any, best: Any, frame: str) -> Claim | None:
    """What one detection says; None of one without extent.

    Raises:
        ValueError: numbers that make no sense; one sentence.
    """
    size, middle = getattr(bbox, "size", None), bbox.center.position
    if size:
        wide, high, depth, box_depth = size.x, size.y, best.pose.pose.position.z, middle.z
        turn = bbox.center.orientation
        if any((turn.x, turn.y, turn.z)):
            raise ValueError(
                f"A detection's box is turned by the quaternion {turn.x:g}, {turn.y:g}, "
                f"{turn.z:g}, {turn.w:g}, expected upright ones."
            )
    else:
        wide, high, depth, box_depth = bbox.size_x, bbox.size_y, 0.0, 0.0
        if bbox.center.theta:
            raise ValueError(
                f"A detection's box is turned by {bbox.center.theta:g} rad, expected upright ones."
            )
    if not all(map(math.isfinite, (middle.x, middle.y, wide, high, depth))):
        raise ValueError("A detection holds a number that is not finite.")
    if min(wide, high) < 0 or not 0 <= depth <= FURTHEST_M:
        raise ValueError(
            f"A detection's box is {wide:g} by {high:g}, {depth:g} m away: expected no "
            f"negative numbers and at most {FURTHEST_M:g} m."
        )
    if min(wide, high) == 0:
        return None
    box = middle.x - wide / 2, middle.y - high / 2, middle.x + wide / 2, middle.y + high / 2
    return Claim(best.hypothesis.class_id, best.hypothesis.score, box, depth, box_depth, frame)


def charge_from_message(message: Any) -> float:
    """Charge of a battery, 0 to 1; nan where it says nothing that makes sense.

    Some drivers say percent, which sensor_msgs/BatteryState does not mean.
    """
    charge = float(message.percentage)
    if 1.0 < charge <= 100.0:
        charge /= 100.0
    return charge if 0.0 <= charge <= 1.0 else math.nan


def bump_zones(message: Any) -> tuple[str, ...]:
    """The bumper's zones that a HazardDetectionVector says are pressed; "" where it names none."""
    return tuple(hazard.header.frame_id for hazard in message.detections if hazard.type == BUMP)


def bump_from_message(message: Any) -> float | None:
    """When the bumper was pressed, seconds; None when the message speaks of no bump."""
    return stamp_to_seconds(message.header.stamp) if bump_zones(message) else None


def bumper_from_message(message: Any) -> bool:
    """Whether the bumper is pressed, in any of its zones."""
    return bool(bump_zones(message))
