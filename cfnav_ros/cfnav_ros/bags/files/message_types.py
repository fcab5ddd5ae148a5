"""Message types of a bag: from the definitions that it holds, else those of ROS 2 Jazzy."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from cfnav_ros.bags.files.storage import BagTopic, Key, Notes, ros_type

MAX_DEFINITION = 200_000
"""Characters; the longest definitions have a tenth of it."""

MAX_ARRAY = 256
"""Longest array of strings or messages of fixed length: the code that reads it grows with it."""

_SPLIT = "=" * 80 + "\n"
_DIRECTIVES = re.compile(r"^(IDL:|[ \t]*#).*$", re.MULTILINE)
"""Lines of IDL that are for the recorder or a preprocessor; what is included stands below."""
_HEADER = (
    f"{_SPLIT}MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    f"{_SPLIT}MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)
_FOUND = (
    f"{_SPLIT}MSG: vision_msgs/ObjectHypothesisWithPose\n"
    "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n"
    f"{_SPLIT}MSG: vision_msgs/ObjectHypothesis\nstring class_id\nfloat64 score\n"
    f"{_SPLIT}MSG: geometry_msgs/PoseWithCovariance\n"
    "geometry_msgs/Pose pose\nfloat64[36] covariance\n"
    f"{_SPLIT}MSG: geometry_msgs/Pose\n"
    "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
    f"{_SPLIT}MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
    f"{_SPLIT}MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
    f"{_HEADER}"
)
_HAZARD = "uint8 BUMP=1\nstd_msgs/Header header\nuint8 type\n"

WITHOUT_DEFINITION = {
    "irobot_create_msgs/msg/HazardDetectionVector": (
        "std_msgs/Header header\nirobot_create_msgs/HazardDetection[] detections\n"
        f"{_SPLIT}MSG: irobot_create_msgs/HazardDetection\n{_HAZARD}{_HEADER}"
    ),
    "irobot_create_msgs/msg/WheelStatus": (
        "std_msgs/Header header\nint16 current_ma_left\nint16 current_ma_right\n"
        f"int16 pwm_left\nint16 pwm_right\nbool wheels_enabled\n{_HEADER}"
    ),
    "irobot_create_msgs/msg/DockStatus": (
        f"std_msgs/Header header\nbool dock_visible\nbool is_docked\n{_HEADER}"
    ),
    "vision_msgs/msg/Detection2DArray": (
        "std_msgs/Header header\nvision_msgs/Detection2D[] detections\n"
        f"{_SPLIT}MSG: vision_msgs/Detection2D\nstd_msgs/Header header\n"
        "vision_msgs/ObjectHypothesisWithPose[] results\nvision_msgs/BoundingBox2D bbox\n"
        f"string id\n{_SPLIT}MSG: vision_msgs/BoundingBox2D\n"
        "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n"
        f"{_SPLIT}MSG: vision_msgs/Pose2D\nvision_msgs/Point2D position\nfloat64 theta\n"
        f"{_SPLIT}MSG: vision_msgs/Point2D\nfloat64 x\nfloat64 y\n{_FOUND}"
    ),
    "vision_msgs/msg/Detection3DArray": (
        "std_msgs/Header header\nvision_msgs/Detection3D[] detections\n"
        f"{_SPLIT}MSG: vision_msgs/Detection3D\nstd_msgs/Header header\n"
        "vision_msgs/ObjectHypothesisWithPose[] results\nvision_msgs/BoundingBox3D bbox\n"
        f"string id\n{_SPLIT}MSG: vision_msgs/BoundingBox3D\n"
        "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\n"
        f"{_SPLIT}MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n{_FOUND}"
    ),
}
"""Types of the robot that ROS 2 does not have: sqlite3 bags of Humble hold no definitions."""


class MessageTypes:
    """Gives the function that deserializes a topic's messages."""

    def __init__(self, notes: Notes) -> None:
        """Know no type yet.

        Args:
            notes: take a sentence for every type that cannot be built.
        """
        self._notes = notes
        self._readers: dict[Key, Callable[[bytes], Any] | None] = {}

    def reader(self, topic: BagTopic) -> Callable[[bytes], Any] | None:
        """The function for a topic; None, and a note, when its type cannot be built.

        It gives an object with the fields of the message. Arrays of numbers are read-only views of
        the bytes, so that a picture costs no more than its header. It raises when they do not fit.
        """
        if topic.key not in self._readers:
            try:
                self._readers[topic.key] = self._build(topic)
            except Exception as error:  # a damaged definition fails anywhere, in any way
                self._notes.add(
                    f"{topic.name} is left out, its type {topic.type} cannot be built: "
                    f"{_said(error)}."
                )
                self._readers[topic.key] = None
        return self._readers[topic.key]

    def hash(self, topic: BagTopic) -> str:
        """The hash of a topic's type as ROS 2 makes it (RIHS01); "" when it cannot be built."""
        return _hash(*_described(topic)) if self.reader(topic) else ""

    def _build(self, topic: BagTopic) -> Callable[[bytes], Any]:
        store = self._types(topic)
        jazzy = get_typestore(Stores.ROS2_JAZZY).fielddefs.get(topic.type)
        if jazzy and store.fielddefs[topic.type][1] != jazzy[1]:
            self._notes.add(
                f"The messages of {topic.name} have other fields than {topic.type} of ROS 2 Jazzy."
            )
        return partial(_deserialize, store, topic.type)

    def _types(self, topic: BagTopic) -> Typestore:
        """The types by the bag's definition, or those that are known where it makes no sense."""
        try:
            return _store(*_described(topic))
        except Exception as error:  # as above
            usual = WITHOUT_DEFINITION.get(topic.type, "")
            if not (usual or topic.type in get_typestore(Stores.ROS2_JAZZY).fielddefs):
                raise
            self._notes.add(
                f"The definition of {topic.type} for {topic.name} makes no sense, so its messages "
                f"are read as ROS 2 Jazzy has them: {_said(error)}."
            )
            return _store(topic.type, usual, "")


def _described(topic: BagTopic) -> tuple[str, str, str]:
    """Name, definition and language of a topic's type."""
    return topic.type, topic.definition or WITHOUT_DEFINITION.get(topic.type, ""), topic.language


def _deserialize(store: Typestore, name: str, data: bytes) -> Any:
    return store.deserialize_cdr(data, name)


@lru_cache(maxsize=128)  # building takes milliseconds a type, and bags of one robot have the same
def _store(name: str, text: str, language: str) -> Typestore:
    """A store that holds a type and those in it: by its definition or, without one, Jazzy's.

    Raises:
        ValueError: there is no definition, or it makes no sense; rosbags raises errors of its own.
    """
    store = get_typestore(Stores.EMPTY if text else Stores.ROS2_JAZZY)
    if text:
        store.register(_parse(name, text, language))
    elif name not in store.fielddefs:
        raise ValueError("the bag holds no definition of it, and ROS 2 Jazzy has no such type")
    store.get_msgdef(name)
    return store


@lru_cache(maxsize=128)
def _hash(name: str, text: str, language: str) -> str:
    return _store(name, text, language).hash_rihs01(name)


def _parse(name: str, text: str, language: str) -> dict:
    """Parse a definition.

    Raises:
        ValueError: it is too long, or would make reading endless.
    """
    if len(text) > MAX_DEFINITION:
        raise ValueError(f"its definition has {len(text)} characters")
    types: dict = {}
    if language in ("ros2idl", "omgidl"):
        for part in _DIRECTIVES.sub("", text).split(_SPLIT):
            if part.strip():
                types.update(get_types_from_idl(part))
        types = {ros_type(key): (consts, _named(fields)) for key, (consts, fields) in types.items()}
    else:
        types.update(get_types_from_msg(text, name))
    for _, fields in types.values():
        for field, (kind, what) in fields:
            if kind == Nodetype.ARRAY and what[1] > MAX_ARRAY and _is_object(what[0]):
                raise ValueError(f"its field {field} has {what[1]} elements")
    return types


def _named(declared: Any) -> Any:
    """The declarations of fields with names of types as ROS 2 has them."""
    if isinstance(declared, list | tuple) and len(declared) == 2 and declared[0] is Nodetype.NAME:
        return (Nodetype.NAME, ros_type(declared[1]))
    if type(declared) in (list, tuple):
        return type(declared)(_named(part) for part in declared)
    return declared


def _said(error: Exception) -> str:
    """What went wrong, in one line."""
    return " ".join(str(error).split())[:200].rstrip(".") or type(error).__name__


def _is_object(element: Any) -> bool:
    """Whether an element of an array is a message or a string."""
    return element[0] == Nodetype.NAME or element[1][0] in ("string", "wstring")
