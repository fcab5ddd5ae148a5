"""The detector on board of the mock: true boxes with a detector's errors, as depthai says them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from vision_msgs.msg import (
    BoundingBox2D,
    Detection2D,
    Detection2DArray,
    ObjectHypothesis,
    ObjectHypothesisWithPose,
    Point2D,
    Pose2D,
)

from cfnav_core.detect.labels import load_labels
from cfnav_core.task.pinhole import Pinhole
from sim_bridge.ros.conversions import CAMERA_FRAME, header
from sim_bridge.world.things import Things

if TYPE_CHECKING:
    from cfnav_core.perception.boxes import Detection
    from sim_bridge.ros.parameters import MockParameters
    from sim_bridge.world.camera import Camera
    from sim_bridge.world.world import Pose


class Detector:
    """Looks through the robot's camera.

    Args:
        parameters: of the mock.
    """

    def __init__(self, parameters: MockParameters) -> None:
        self._errors = parameters.errors
        labels = load_labels(parameters.detector_labels)
        self._numbers = {labels.category(name): n for n, name in labels.names.items()}
        self._things: tuple[Camera, Things] | None = None
        self.reseed(parameters.seed)

    def reseed(self, seed: int) -> None:
        """Draw its errors anew from a seed."""
        self._rng = np.random.default_rng([seed, 2])

    def says(self, camera: Camera, pose: Pose) -> list[tuple[int, Detection]]:
        """What it says of what a camera sees at a pose, with the number of each class."""
        if self._things is None or self._things[0] is not camera:
            self._things = camera, Things(camera)
        there = self._things[1].seen(pose, camera.owners(pose))
        size = camera.set_up.size
        degree = Pinhole.of(camera.set_up).fx * math.radians(1)
        said = self._errors.says(there, tuple(self._numbers), size, degree, self._rng)
        return [(self._numbers[found.name], found) for found, _ in said]


def detections(found: Iterable[tuple[int, Detection]], t: float) -> Detection2DArray:
    """What a detector says of a picture, as depthai_ros_driver says it: classes by number.

    Each detection's own header is empty, and its id is the number again.
    """
    return Detection2DArray(
        header=header(t, CAMERA_FRAME), detections=[_detection(n, one) for n, one in found]
    )


def _detection(number: int, one: Detection) -> Detection2D:
    left, top, right, bottom = one.box
    said = ObjectHypothesis(class_id=str(number), score=one.score)
    middle = Pose2D(position=Point2D(x=(left + right) / 2, y=(top + bottom) / 2))
    return Detection2D(
        results=[ObjectHypothesisWithPose(hypothesis=said)], id=str(number),
        bbox=BoundingBox2D(center=middle, size_x=right - left, size_y=bottom - top),
    )  # fmt: skip
