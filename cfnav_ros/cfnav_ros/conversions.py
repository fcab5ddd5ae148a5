"""ROS messages to and from numpy, plain numbers and the pure modules' types; no other logic."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable
from functools import partial

import numpy as np
from builtin_interfaces.msg import Time
from cfnav_interfaces.action import NavigateToObject
from cfnav_interfaces.msg import CollisionEstimate, EpisodeStatus, MotionEstimate, PolicyDecision
from cfnav_interfaces.msg import Moment as MomentMessage
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Twist, TwistStamped
from irobot_create_msgs.msg import HazardDetection, HazardDetectionVector
from nav_msgs.msg import Odometry as OdometryMessage
from rclpy.qos import QoSCompatibility, qos_check_compatible
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from sensor_msgs.msg import Image, JointState, LaserScan
from std_msgs.msg import Header

from cfnav_ros.diagnostics import Report
from cfnav_ros.episode import Episode, StepRecord
from cfnav_ros.inputs import Frame, StampedEstimate, Tilt
from cfnav_ros.lidar import Estimate, Scan, Verdict
from cfnav_ros.lock_step import Moment
from cfnav_ros.motion import Command, Odometry
from cfnav_ros.preflight import Endpoint, Source

CHANNELS = {
    "rgb8": (0, 1, 2),
    "bgr8": (2, 1, 0),
    "rgba8": (0, 1, 2),
    "bgra8": (2, 1, 0),
    "mono8": (0, 0, 0),
}
"""Where red, green and blue stand in a pixel of each encoding."""

PIXEL_BYTES = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4, "mono8": 1}

MAX_PIXELS = 4096 * 4096
"""Larger pictures come from no camera of this robot."""


def image_to_rgb(message: Image, every: int = 1) -> np.ndarray:
    """Decode a picture.

    Args:
        message: 8-bit, any of ``CHANNELS``; rows may be padded (``step``). ``is_bigendian`` has no
            meaning for 8 bits and is set at will by drivers.
        every: rows and columns that are left out make it cheaper; 1 takes all.

    Returns:
        uint8 [H, W, 3] RGB, a copy; H and W divided by ``every``, rounded up.

    Raises:
        ValueError: another encoding, an empty or too large picture, too little data; one sentence.
    """
    height, width, encoding = message.height, message.width, message.encoding
    if encoding not in CHANNELS:
        raise ValueError(
            f"The picture is encoded as {encoding!r}, expected one of {', '.join(CHANNELS)}: "
            "set the camera driver to one of them."
        )
    if not 0 < height * width <= MAX_PIXELS:
        raise ValueError(f"The picture is {width}x{height}, expected 1 to {MAX_PIXELS} pixels.")
    row = width * PIXEL_BYTES[encoding]
    if message.step < row:
        raise ValueError(
            f"The picture's step is {message.step} bytes, expected at least {row} for {width} "
            f"pixels of {encoding}."
        )
    data = np.asarray(message.data, np.uint8)
    if data.size < message.step * height:
        raise ValueError(
            f"The picture holds {data.size} bytes, expected {message.step * height} for {height} "
            f"rows of {message.step}."
        )
    rows = data[: message.step * height].reshape(height, message.step)[:, :row]
    return rows.reshape(height, width, -1)[::every, ::every][:, :, CHANNELS[encoding]]


def rgb_to_image(rgb: np.ndarray, stamp: Time, frame: str) -> Image:
    """Encode a picture as rgb8.

    Args:
        rgb: uint8 [H, W, 3].
        stamp: when it was taken.
        frame: of the camera.
    """
    height, width, _ = rgb.shape
    message = Image(header=Header(stamp=stamp, frame_id=frame), height=height, width=width)
    message.encoding, message.step = "rgb8", 3 * width
    # rclpy takes an array over as it is; any other type it copies byte by byte.
    message.data = array("B", np.ascontiguousarray(rgb).tobytes())
    return message


def stamp_to_ns(stamp: Time) -> int:
    """Nanoseconds of a stamp."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def ns_to_stamp(ns: int) -> Time:
    """The stamp of a number of nanoseconds."""
    return Time(sec=ns // 1_000_000_000, nanosec=ns % 1_000_000_000)


def stamp_to_seconds(stamp: Time) -> float:
    """Seconds of a stamp."""
    return stamp_to_ns(stamp) * 1e-9


def frame_from_message(message: Image) -> Frame:
    """The picture, to be decoded by whoever looks at it: most are never looked at."""
    stamp = stamp_to_ns(message.header.stamp)
    decode = partial(image_to_rgb, message)
    return Frame(stamp, decode, message.height, message.width, message.data)


def scan_from_message(message: LaserScan) -> Scan:
    """The scan's fields; whether they make sense is judged by ``lidar``."""
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


def estimate_to_message(estimate: Estimate, stamp: Time) -> CollisionEstimate:
    """The estimate made from the scan with this stamp."""
    return CollisionEstimate(
        header=Header(stamp=stamp, frame_id="base_link"),
        probability=estimate.probability,
        clearance=estimate.clearance,
        verdict=int(estimate.verdict),
        reason=estimate.reason,
        known_fraction=estimate.known_fraction,
        others=[
            MotionEstimate(
                motion=other.motion,
                probability=other.probability,
                clearance=other.clearance,
                verdict=int(other.verdict),
            )
            for other in estimate.others
        ],
    )


def estimate_from_message(message: CollisionEstimate) -> StampedEstimate:
    """The estimate in a message.

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


def odometry_from_message(message: OdometryMessage) -> Odometry:
    """Planar pose and velocity.

    Raises:
        ValueError: a value that is not finite, or no unit quaternion; one sentence.
    """
    pose, twist = message.pose.pose, message.twist.twist
    q = pose.orientation
    values = (pose.position.x, pose.position.y, twist.linear.x, twist.angular.z)
    if not all(map(math.isfinite, values)):
        raise ValueError("Odometry holds a value that is not finite.")
    norm = math.sqrt(q.x**2 + q.y**2 + q.z**2 + q.w**2)
    if not abs(norm - 1.0) < 0.01:
        raise ValueError(f"Odometry holds a quaternion of length {norm:g}, expected 1.")
    yaw = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))
    stamp = stamp_to_seconds(message.header.stamp)
    return Odometry(stamp, pose.position.x, pose.position.y, yaw, twist.linear.x, twist.angular.z)


def tilt_from_message(message: JointState, joint: str) -> Tilt | None:
    """The camera's tilt, None when the message speaks of other joints."""
    if joint not in message.name or len(message.position) != len(message.name):
        return None
    angle = message.position[message.name.index(joint)]
    if not math.isfinite(angle):
        return None
    return Tilt(stamp_to_seconds(message.header.stamp), angle)


def bump_from_message(message: HazardDetectionVector) -> float | None:
    """When the bumper was pressed, seconds; None when the message speaks of no bump."""
    if all(hazard.type != HazardDetection.BUMP for hazard in message.detections):
        return None
    return stamp_to_seconds(message.header.stamp)


def front_bump_from_message(message: HazardDetectionVector) -> float | None:
    """When a zone of the bumper that faces forward was pressed, seconds; None when none was.

    A detection that does not name its zone may be any.
    """
    for hazard in message.detections:
        zone = hazard.header.frame_id
        if hazard.type == HazardDetection.BUMP and ("front" in zone or not zone):
            return stamp_to_seconds(message.header.stamp)
    return None


def twist(command: Command) -> Twist:
    """A velocity as geometry_msgs/Twist."""
    message = Twist()
    message.linear.x, message.angular.z = float(command.v), float(command.w)
    return message


def twist_stamped(command: Command, stamp: Time, frame: str) -> TwistStamped:
    """A velocity as geometry_msgs/TwistStamped."""
    return TwistStamped(header=Header(stamp=stamp, frame_id=frame), twist=twist(command))


def endpoints(infos: Iterable[TopicEndpointInfo]) -> list[Endpoint]:
    """Subscribers of a topic as the graph knows them."""
    return [Endpoint(info.node_name, info.topic_type) for info in infos]


def moment_from_message(message: MomentMessage) -> Moment:
    """A moment of a simulator in lock-step."""
    return Moment(
        stamp_to_ns(message.stamp),
        stamp_to_ns(message.image),
        stamp_to_ns(message.scan),
        stamp_to_ns(message.odometry),
    )


def sources(infos: Iterable[TopicEndpointInfo], listener: Subscription) -> list[Source]:
    """Publishers of a topic as the graph knows them, and whether a subscription hears them."""
    found = []
    for info in infos:
        compatibility, reason = qos_check_compatible(info.qos_profile, listener.qos_profile)
        clash = reason if compatibility == QoSCompatibility.ERROR else ""
        found.append(Source(info.node_name, info.topic_type, clash))
    return found


def type_name(message: type) -> str:
    """The name of a message type as the graph has it, such as sensor_msgs/msg/Image."""
    return f"{message.__module__.split('.')[0]}/msg/{message.__name__}"


def diagnostics(reports: Iterable[Report], node: str, now: Time) -> DiagnosticArray:
    """Rows of /diagnostics; node is the full name of the one that they are about."""
    rows = [
        DiagnosticStatus(
            name=f"{node}: {report.name}",
            hardware_id=node,
            level=bytes([report.level]),
            message=report.message,
            values=[KeyValue(key=key, value=value) for key, value in report.values.items()],
        )
        for report in reports
    ]
    return DiagnosticArray(header=Header(stamp=now), status=rows)


def decision(record: StepRecord, goal: str, now: Time, zero_ns: int = 0) -> PolicyDecision:
    """A decision as it is published before it is executed.

    Args:
        record: what was decided.
        goal: what is looked for.
        now: stamp of the message.
        zero_ns: node time from which the record's stamps count, nanoseconds.
    """
    made = record.decision
    return PolicyDecision(
        header=Header(stamp=now, frame_id="base_link"),
        goal=goal,
        step=record.step,
        image_stamp=ns_to_stamp(record.image_stamp_ns + zero_ns),
        estimate_stamp=ns_to_stamp(
            record.estimate_stamp_ns + zero_ns if record.estimate_stamp_ns else 0
        ),
        action=int(made.action),
        action_probabilities=np.asarray(made.probabilities, np.float32),
        collision_probability=float(made.collision_probability),
        detection_score=float(made.detection_score),
        vetoed=bool(record.vetoed),
    )


def feedback(record: StepRecord, path_length: float) -> NavigateToObject.Feedback:
    """A decision as the client of the action hears of it; path length in metres."""
    return NavigateToObject.Feedback(
        step=record.step,
        action=record.decision.action.name,
        collision_probability=float(record.decision.collision_probability),
        detection_score=float(record.decision.detection_score),
        path_length=path_length,
    )


def status(episode: Episode, phase: int, bundle: str, now: Time) -> EpisodeStatus:
    """Start or end of an episode; phase as in EpisodeStatus."""
    return EpisodeStatus(
        header=Header(stamp=now, frame_id="base_link"),
        phase=phase,
        goal=episode.goal,
        bundle=bundle,
        outcome=episode.outcome,
        message=episode.message,
        steps=episode.steps,
        path_length=episode.track.path_length,
        vetoes=episode.vetoes,
        bumps=episode.track.bumps,
    )


def result(episode: Episode) -> NavigateToObject.Result:
    """How an episode ended, for the client of the action."""
    return NavigateToObject.Result(
        outcome=episode.outcome,
        message=episode.message,
        steps=episode.steps,
        path_length=episode.track.path_length,
        vetoes=episode.vetoes,
        bumps=episode.track.bumps,
    )
