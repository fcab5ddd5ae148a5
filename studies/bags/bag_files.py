"""Small real bags of a short synthetic drive, in every storage, compression and split."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from cfnav_ros.bags.files.writer import BagWriter, typestore_with
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.interfaces import Nodetype
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionFormat
from ruamel.yaml import YAML

ROOT = Path(__file__).resolve().parents[2]
STORE = typestore_with([
    ROOT / "ros_ws/src/cfnav_interfaces", ROOT / "ros_ws/fallback/irobot_create_msgs",
    ROOT / "ros_ws/fallback/vision_msgs",
])  # fmt: skip
S = 1_000_000_000
ZERO_NS = 1_700_000_000 * S
"""When the drive begins."""


class Message(NamedTuple):
    """One message to be recorded."""

    topic: str
    type: str
    log_ns: int
    message: Any

    @property
    def cdr(self) -> bytes:
        return bytes(STORE.serialize_cdr(self.message, self.type))


def make(kind: str, /, **fields: Any) -> Any:
    """A message of a type such as ``sensor_msgs/msg/Image``; what is not given is zero or empty."""
    _, declared = STORE.fielddefs[kind]
    rest = {name: _zero(what) for name, what in declared if name not in fields}
    return STORE.types[kind](**rest, **fields)


def _zero(declared: Any) -> Any:
    """The value of a field that says nothing, by its declaration as ``rosbags`` has it."""
    node, what = declared
    if node is Nodetype.NAME:
        return make(what)
    if node is Nodetype.BASE:
        kind, _ = what
        return "" if kind == "string" else np.zeros((), kind).item()
    (of, element), length = what
    if of is Nodetype.BASE and element[0] != "string":
        return np.zeros(length, element[0])
    return [_zero((of, element)) for _ in range(length)]


def stamp(ns: int) -> Any:
    return make("builtin_interfaces/msg/Time", sec=ns // S, nanosec=ns % S)


def header(ns: int, frame: str = "base_link") -> Any:
    return make("std_msgs/msg/Header", stamp=stamp(ns), frame_id=frame)


def vector(x: float = 0.0, y: float = 0.0, z: float = 0.0, kind: str = "Vector3") -> Any:
    return make(f"geometry_msgs/msg/{kind}", x=x, y=y, z=z)


def turn(yaw: float = 0.0) -> Any:
    z, w = float(np.sin(yaw / 2)), float(np.cos(yaw / 2))
    return make("geometry_msgs/msg/Quaternion", z=z, w=w)


def image(ns: int, shade: int = 0, encoding: str = "bgr8", side: int = 24) -> Any:
    """A square picture that differs with ``shade``."""
    data = np.random.default_rng(shade).integers(0, 256, side * side * 3, np.uint8)
    return make(
        "sensor_msgs/msg/Image",
        header=header(ns, "camera"),
        height=side,
        width=side,
        encoding=encoding,
        step=side * 3,
        data=data,
    )


def scan(ns: int, nearest: float = 1.0) -> Any:
    ranges = np.linspace(nearest, nearest + 2, 60, dtype=np.float32)
    return make(
        "sensor_msgs/msg/LaserScan",
        header=header(ns, "rplidar_link"),
        angle_min=-3.0,
        angle_max=2.9,
        angle_increment=0.1,
        scan_time=0.125,
        range_min=0.15,
        range_max=12.0,
        ranges=ranges,
    )


def twist(v: float, w: float) -> Any:
    return make("geometry_msgs/msg/Twist", linear=vector(v), angular=vector(0.0, 0.0, w))


def pose(x: float, y: float, yaw: float) -> Any:
    place = vector(x, y, kind="Point")
    return make("geometry_msgs/msg/Pose", position=place, orientation=turn(yaw))


def odometry(ns: int, x: float, yaw: float = 0.0, v: float = 0.2) -> Any:
    return make(
        "nav_msgs/msg/Odometry",
        header=header(ns, "odom"),
        child_frame_id="base_link",
        pose=make("geometry_msgs/msg/PoseWithCovariance", pose=pose(x, 0.5, yaw)),
        twist=make("geometry_msgs/msg/TwistWithCovariance", twist=twist(v, 0.1)),
    )


def command(ns: int, v: float) -> Any:
    return make("geometry_msgs/msg/TwistStamped", header=header(ns), twist=twist(v, 0.0))


def hazards(ns: int, *zones: str) -> Any:
    kind, cliff = "irobot_create_msgs/msg/HazardDetection", header(ns, "cliff")
    bumps = [make(kind, header=header(ns, zone), type=1) for zone in zones]
    detections = [make(kind, header=cliff, type=2), *bumps]
    return make(f"{kind}Vector", header=header(ns), detections=detections)


def joints(ns: int, angle: float, name: str = "camera_tilt") -> Any:
    return make(
        "sensor_msgs/msg/JointState",
        header=header(ns),
        name=["wheel", name],
        position=np.array([0.0, angle]),
    )


def frames(ns: int, child: str) -> Any:
    transform = make(
        "geometry_msgs/msg/Transform", translation=vector(0.1, 0.0, 0.2), rotation=turn(0.5)
    )
    stamped = make(
        "geometry_msgs/msg/TransformStamped",
        header=header(ns),
        child_frame_id=child,
        transform=transform,
    )
    return make("tf2_msgs/msg/TFMessage", transforms=[stamped])


def detections(ns: int, class_id: str = "41") -> Any:
    """A detector's word of one thing in the upper left of the picture."""
    kinds = "vision_msgs/msg/"
    said = make(f"{kinds}ObjectHypothesis", class_id=class_id, score=0.8)
    middle = make(f"{kinds}Pose2D", position=make(f"{kinds}Point2D", x=20.0, y=20.0))
    one = make(
        f"{kinds}Detection2D",
        results=[make(f"{kinds}ObjectHypothesisWithPose", hypothesis=said)],
        bbox=make(f"{kinds}BoundingBox2D", center=middle, size_x=10.0, size_y=10.0),
    )
    return make(f"{kinds}Detection2DArray", header=header(ns), detections=[one])


def estimate(ns: int, probability: float) -> Any:
    return make(
        "cfnav_interfaces/msg/CollisionEstimate",
        header=header(ns),
        probability=probability,
        clearance=0.5,
        verdict=1,
        reason="Part is unknown.",
        known_fraction=0.75,
    )


def decision(ns: int, step: int) -> Any:
    return make(
        "cfnav_interfaces/msg/PolicyDecision",
        header=header(ns),
        goal="Laptop",
        step=step,
        image_stamp=stamp(ns - S // 10),
        estimate_stamp=stamp(ns - S // 20),
        action=step % 6,
        action_probabilities=np.full(6, 1 / 6, np.float32),
        collision_probability=0.25,
        detection_score=0.5,
    )


def status(ns: int, phase: int) -> Any:
    return make(
        "cfnav_interfaces/msg/EpisodeStatus",
        header=header(ns),
        phase=phase,
        goal="Laptop",
        bundle="demo",
        outcome="success" if phase else "",
        steps=4,
        path_length=0.5,
    )


def truth(ns: int, x: float) -> Any:
    return make(
        "cfnav_interfaces/msg/GroundTruth",
        header=header(ns, "room"),
        x=x,
        y=0.5,
        v=0.2,
        room="kitchen:25",
        goal="Laptop",
        shortest_path=2.0,
    )


def grid(ns: int, yaw: float = 0.0) -> Any:
    info = make(
        "nav_msgs/msg/MapMetaData", resolution=0.02, width=5, height=4, origin=pose(-1.0, -2.0, yaw)
    )
    cells = np.zeros(20, np.int8)
    cells[:5] = 100
    return make("nav_msgs/msg/OccupancyGrid", header=header(ns, "room"), info=info, data=cells)


def camera_info(ns: int) -> Any:
    return make(
        "sensor_msgs/msg/CameraInfo",
        header=header(ns, "camera"),
        height=24,
        width=24,
        distortion_model="plumb_bob",
        d=np.zeros(5),
    )


def drive(seconds: float = 2.0, namespace: str = "") -> list[Message]:
    """A drive with every role, a tenth of a second at a time."""
    said: list[Message] = []

    def say(topic: str, ns: int, message: Any) -> None:
        kind = message.__msgtype__
        said.append(Message(f"{namespace}/{topic}", kind, ns + len(said) % 7, message))

    t = ZERO_NS
    say("tf_static", t, frames(t, "rplidar_link"))
    say("ground_truth/map", t, grid(t))
    say("policy/episode", t, status(t, 0))
    for n in range(round(seconds * 10)):
        t, x = ZERO_NS + n * S // 10, 0.02 * n
        say("clock", t, make("rosgraph_msgs/msg/Clock", clock=stamp(t)))
        say("oakd/rgb/preview/image_raw", t + 1000, image(t, n))
        say("oakd/rgb/preview/camera_info", t + 2000, camera_info(t))
        say("detections", t + 2500, detections(t))
        say("scan", t + 3000, scan(t, 1.0 + x))
        say("collision/estimate", t + 4000, estimate(t, n / 100))
        say("odom", t + 5000, odometry(t, x, n / 10))
        say("tf", t + 6000, frames(t, "oakd_link"))
        say("joint_states", t + 7000, joints(t, -0.5))
        say("hazard_detection", t + 8000, hazards(t, *["bump_front_left"] * (n == 7)))
        say("cmd_vel", t + 9000, command(t, 0.2))
        say("ground_truth/state", t + 10_000, truth(t, x))
        if n % 5 == 4:
            say("policy/decision", t + 11_000, decision(t, 1 + n // 5))
    say("policy/episode", t + 12_000, status(t, 1))
    return said


def write(
    path: Path,
    messages: Sequence[Message],
    storage: StoragePlugin = StoragePlugin.MCAP,
    compression: CompressionMode = CompressionMode.NONE,
    silent: Sequence[tuple[str, str]] = (),
) -> Path:
    """Write a bag as ``rosbags`` does; ``silent`` are topics (name, type) without messages."""
    with_compression = Writer(path, version=9, storage_plugin=storage)
    with_compression.set_compression(compression, CompressionFormat.ZSTD)
    with with_compression as writer:
        keys = dict.fromkeys([*((m.topic, m.type) for m in messages), *silent])
        topics = {key: writer.add_connection(*key, typestore=STORE) for key in keys}
        for message in messages:
            writer.write(topics[message.topic, message.type], message.log_ns, message.cdr)
    return path


def record(path: Path, messages: Sequence[Message]) -> Path:
    """Write a bag as our own recorder does."""
    writer = BagWriter(path, STORE)
    for topic, kind in dict.fromkeys((m.topic, m.type) for m in messages):
        writer.add_topic(topic, kind)
    for message in messages:
        writer.write(message.topic, message.log_ns, message.cdr)
    writer.close()
    return path


def write_mcap(
    path: Path,
    messages: Sequence[Message],
    compression: CompressionType = CompressionType.ZSTD,
    chunk: int = 16_000,
    chunked: bool = True,
    names: Mapping[str, str] = MappingProxyType({}),
) -> Path:
    """Write an MCAP file as ``ros2 bag record`` does: small chunks, each with its checksum.

    ``names`` are other names of types.
    """
    with path.open("wb") as file:
        writer = McapWriter(file, chunk, compression, use_chunking=chunked)
        writer.start("ros2", "tests")
        channels: dict[tuple[str, str], int] = {}
        for message in messages:
            key = (message.topic, message.type)
            if key not in channels:
                text, _ = STORE.generate_msgdef(message.type, ros_version=2)
                schema = writer.register_schema(
                    names.get(message.type, message.type), "ros2msg", text.encode()
                )
                channels[key] = writer.register_channel(message.topic, "cdr", schema)
            writer.add_message(channels[key], message.log_ns, message.cdr, message.log_ns)
        writer.finish()
    return path


def split(path: Path, messages: Sequence[Message], parts: int = 3, **how: Any) -> Path:
    """Write a bag in several files."""
    yaml, bounds = YAML(typ="safe", pure=True), np.linspace(0, len(messages), parts + 1).astype(int)
    path.mkdir()
    said: dict = {}
    for n in range(parts):
        part = write(path / f"part_{n}", messages[bounds[n] : bounds[n + 1]], **how)
        (file,) = (p for p in part.iterdir() if p.name != "metadata.yaml")
        file.rename(path / file.name)
        new = yaml.load((part / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
        shutil.rmtree(part)
        if not said:
            said = new
            continue
        said["relative_file_paths"] += new["relative_file_paths"]
        counted = {t["topic_metadata"]["name"]: t for t in said["topics_with_message_count"]}
        for topic in new["topics_with_message_count"]:
            name = topic["topic_metadata"]["name"]
            if name in counted:
                counted[name]["message_count"] += topic["message_count"]
            else:
                said["topics_with_message_count"].append(topic)
    with (path / "metadata.yaml").open("w") as head:
        yaml.dump({"rosbag2_bagfile_information": said}, head)
    return path


MCAP, SQLITE = StoragePlugin.MCAP, StoragePlugin.SQLITE3
NONE, BY_FILE, BY_MESSAGE = CompressionMode.NONE, CompressionMode.FILE, CompressionMode.MESSAGE

VARIANTS: dict[str, Callable[[Path, Sequence[Message]], Path]] = {
    "recorded": record,
    "mcap": lambda path, said: write(path, said),
    "mcap zstd storage": lambda path, said: write(path, said, MCAP, CompressionMode.STORAGE),
    "mcap zstd message": lambda path, said: write(path, said, MCAP, BY_MESSAGE),
    "mcap zstd file": lambda path, said: write(path, said, MCAP, BY_FILE),
    "mcap split": lambda path, said: split(path, said),
    "mcap split zstd file": lambda path, said: split(path, said, compression=BY_FILE),
    "sqlite": lambda path, said: write(path, said, SQLITE),
    "sqlite zstd message": lambda path, said: write(path, said, SQLITE, BY_MESSAGE),
    "sqlite zstd file": lambda path, said: write(path, said, SQLITE, BY_FILE),
    "sqlite split": lambda path, said: split(path, said, storage=SQLITE),
    "sqlite split zstd file": lambda p, said: split(p, said, storage=SQLITE, compression=BY_FILE),
    "mcap chunks": lambda path, said: write_mcap(path.with_suffix(".mcap"), said),
    "mcap chunks lz4": lambda p, said: write_mcap(
        p.with_suffix(".mcap"), said, CompressionType.LZ4
    ),
    "mcap chunks plain": lambda p, said: write_mcap(
        p.with_suffix(".mcap"), said, CompressionType.NONE
    ),
    "mcap without chunks": lambda p, said: write_mcap(p.with_suffix(".mcap"), said, chunked=False),
}
"""Writers of the same messages, by what the bag is like."""
