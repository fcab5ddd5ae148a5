"""ROS messages to and from numpy, plain numbers and the pure modules' types; no other logic."""

from __future__ import annotations

import uuid
from collections.abc import Iterable
from functools import partial

import numpy as np
from builtin_interfaces.msg import Time
from cfnav_interfaces.action import NavigateToObject
from cfnav_interfaces.msg import CollisionEstimate, EpisodeStatus, MotionEstimate, PolicyDecision
from cfnav_interfaces.msg import Moment as MomentMessage
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.node import Node
from rclpy.qos import QoSCompatibility, qos_check_compatible
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Bool, Header
from vision_msgs.msg import (
    BoundingBox2D,
    Detection2D,
    Detection2DArray,
    ObjectHypothesis,
    ObjectHypothesisWithPose,
    Point2D,
    Pose2D,
)

from cfnav_core.perception.boxes import Detection
from cfnav_ros.drive.diagnostics import Report
from cfnav_ros.drive.episode import Episode
from cfnav_ros.drive.fields import stamp_to_ns
from cfnav_ros.drive.inputs import CameraFrame
from cfnav_ros.drive.lock_step import Moment
from cfnav_ros.drive.motion import Command
from cfnav_ros.drive.phases import StepRecord
from cfnav_ros.drive.preflight import Endpoint, InputPublisher
from cfnav_ros.lidar.estimate import Estimate
from cfnav_ros.robot import pictures
from cfnav_ros.robot.speakers import Speaker


def image_to_rgb(message: Image, every: int = 1) -> np.ndarray:
    """Decode a picture in one of the encodings that the policy node drives on.

    Args:
        message: 8-bit, any of ``pictures.LIVE``; rows may be padded (``step``).
        every: rows and columns that are left out make it cheaper; 1 takes all.

    Returns:
        uint8 [H, W, 3] RGB, a copy; H and W divided by ``every``, rounded up.

    Raises:
        ValueError: another encoding, an empty or too large picture, too little data; one sentence.
    """
    return pictures.image_to_rgb(message, every, pictures.LIVE)


def ns_to_stamp(ns: int) -> Time:
    """The stamp of a number of nanoseconds."""
    return Time(sec=ns // 1_000_000_000, nanosec=ns % 1_000_000_000)


def frame_from_message(message: Image | CompressedImage) -> CameraFrame:
    """The picture, to be decoded by whoever looks at it."""
    stamp, data = stamp_to_ns(message.header.stamp), message.data
    if isinstance(message, Image):
        decode = partial(image_to_rgb, message)
        return CameraFrame(stamp, decode, message.height, message.width, data)
    decode, fault, size = partial(pictures.compressed_to_rgb, message), "", (0, 0)
    try:
        size = pictures.compressed_size(message)
    except ValueError as error:
        fault = str(error)
    return CameraFrame(stamp, decode, *size, data, fault)


def detections_to_message(found: Iterable[Detection], header: Header) -> Detection2DArray:
    """What a detector found in the picture with this header."""
    return Detection2DArray(header=header, detections=[_detection(one, header) for one in found])


def _detection(one: Detection, header: Header) -> Detection2D:
    hypothesis = ObjectHypothesis(class_id=one.name, score=one.score)
    left, top, right, bottom = one.box
    middle = Point2D(x=(left + right) / 2, y=(top + bottom) / 2)
    return Detection2D(
        header=header,
        results=[ObjectHypothesisWithPose(hypothesis=hypothesis)],
        bbox=BoundingBox2D(
            center=Pose2D(position=middle), size_x=right - left, size_y=bottom - top
        ),
    )


def estimate_to_message(
    estimate: Estimate, stamp: Time, frame: str = "base_link"
) -> CollisionEstimate:
    """The estimate made from the scan with this stamp, ahead of the robot with this frame."""
    return CollisionEstimate(
        header=Header(stamp=stamp, frame_id=frame),
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


def moment_from_message(message: MomentMessage, of_detections: bool = False) -> Moment:
    """A moment of a simulator in lock-step, for a policy that looks at pictures or detections."""
    return Moment(
        stamp_to_ns(message.stamp),
        stamp_to_ns(message.detections if of_detections else message.image),
        stamp_to_ns(message.scan),
        stamp_to_ns(message.odometry),
    )


def sources(infos: Iterable[TopicEndpointInfo], listener: Subscription) -> list[InputPublisher]:
    """Publishers of a topic as the graph knows them, and whether a subscription hears them."""
    found = []
    for info in infos:
        compatibility, reason = qos_check_compatible(info.qos_profile, listener.qos_profile)
        clash = reason if compatibility == QoSCompatibility.ERROR else ""
        found.append(InputPublisher(info.node_name, info.topic_type, clash))
    return found


def participant(info: TopicEndpointInfo) -> bytes:
    """The DDS participant of an endpoint: the first 12 bytes of its GID (RTPS 2.5, 8.2.4.2)."""
    return bytes(info.endpoint_gid[:12])


def own_participant(node: Node) -> bytes:
    """That of a node, read off a topic that only it publishes: names can be had twice."""
    topic = f"~/own_{uuid.uuid4().hex}"
    publisher = node.create_publisher(Bool, topic, 1)
    (info,) = node.get_publishers_info_by_topic(publisher.topic_name)
    node.destroy_publisher(publisher)
    return participant(info)


def speakers(infos: Iterable[TopicEndpointInfo], kind: str) -> list[Speaker]:
    """Publishers of a topic as the graph knows them; those of another type reach nobody here."""
    return [
        Speaker(bytes(info.endpoint_gid), info.node_name)
        for info in infos
        if info.topic_type == kind
    ]


def type_name(listener: Subscription) -> str:
    """The type of a subscription as the graph has it, such as sensor_msgs/msg/Image."""
    kind = listener.msg_type
    assert isinstance(kind, type)
    return f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"


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


def decision(
    record: StepRecord,
    goal: str,
    now: Time,
    zero_ns: int = 0,
    frame: str = "base_link",
    by_detections: bool = False,
) -> PolicyDecision:
    """A decision as it is published before it is executed.

    Args:
        record: what was decided.
        goal: what is looked for.
        now: stamp of the message.
        zero_ns: node time from which the record's stamps count, nanoseconds.
        frame: of the robot.
        by_detections: the policy reads what a detector says.
    """
    made = record.decision
    return PolicyDecision(
        header=Header(stamp=now, frame_id=frame),
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
        met_before=bool(record.met_before),
        by_detections=by_detections,
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


def result(episode: Episode) -> NavigateToObject.Result:
    """How an episode ended, for the client of the action; how it stands before its end."""
    return NavigateToObject.Result(
        outcome=episode.outcome,
        message=episode.message,
        steps=episode.steps,
        path_length=episode.track.path_length,
        vetoes=episode.vetoes,
        bumps=episode.track.bumps,
    )


def status(
    goal: str, phase: int, result: NavigateToObject.Result, bundle: str, now: Time
) -> EpisodeStatus:
    """Start or end of an episode, or the end of a goal that never began; phase as in it."""
    return EpisodeStatus(
        header=Header(stamp=now, frame_id="base_link"),
        phase=phase,
        goal=goal,
        bundle=bundle,
        outcome=result.outcome,
        message=result.message,
        steps=result.steps,
        path_length=result.path_length,
        vetoes=result.vetoes,
        bumps=result.bumps,
    )
