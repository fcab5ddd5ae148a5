"""What a detector's messages mean: which goals are seen in which directions, and how far. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from cfnav_core.detect.detector import LEAST
from cfnav_core.detect.labels import load_labels
from cfnav_core.detect.sightings import Ranging, Sighting, by_ranges, by_size, known_sizes, sighted
from cfnav_core.perception.boxes import Box, Detection
from cfnav_core.robot.robot import Robot
from cfnav_core.robot.settings import setting
from cfnav_core.task.camera import ASPECT_TOLERANCE
from cfnav_core.task.pinhole import Pinhole
from cfnav_ros.drive.camera_watch import ToldCamera
from cfnav_ros.drive.fields import FURTHEST_M, Claim
from cfnav_ros.drive.inputs import CameraFrame
from cfnav_ros.lidar.returns import Mount, Scan, malformed, points_around
from cfnav_ros.robot.stamps import seconds

MOCK_LABELS = "cfnav"
"""By whose numbers the mock's detector says what it knows."""

FAR_BY, BOXES = ("lidar", "size", "nothing"), ("pixels", "metres")

SCAN_AGES_S, KEPT_S = (0.2, 0.5), 10.5
"""A scan is asked about pictures so much later than its stamp, that of the beginning of its turn:
then it has come, in whatever order messages come, and a bag is judged as it was driven. An older
one may have been taken before the robot stood. Detections may be as late as ``AgeLimits.frame``
allows at most, and scans are kept for so long."""

FOV_DEG = (10.0, 150.0)
"""What a pinhole's view is across and down; an uncalibrated driver may say anything."""

LARGEST = 2.0
"""Sides of a picture along which a box may lie. Detectors say how far a thing reaches beyond the
picture, too, but what they see of it is in its middle."""

LEAST_PX = 1.0
"""A box that is smaller both ways is told in shares of the picture instead of pixels."""


@dataclass(frozen=True)
class DetectionSettings:
    """How the policy takes what a detector says."""

    labels: str = setting(
        "coco", "what it learnt: cfnav, coco, coco_ids, voc, objects365, open_images or a file"
    )
    least: float = setting(
        LEAST, "score of what counts; policies learnt from detectors that say no less", 0.0, 1.0
    )
    boxes: Literal["pixels", "metres"] = setting(
        "pixels",
        "what its boxes are in: pixels, those of a Detection3DArray too, as depthai fills it; or "
        "metres along the camera's axes, as vision_msgs means that",
    )
    width: int = setting(0, "of the picture its boxes are in, pixels; 0: camera_info's", 0, 10000)
    height: int = setting(0, "the same of its height", 0, 10000)
    squeezed: bool = setting(
        False, "that picture shows all of camera_info's, squeezed to this width and height"
    )
    far_by: Literal["lidar", "size", "nothing"] = setting(
        "lidar",
        "how far a thing is that it says nothing of: lidar (what is in its direction), size (how "
        "large such things are) or nothing",
    )
    tilt_deg: float = setting(
        0.0, "by which a camera that cannot tilt looks up, negative down", -85.0, 85.0
    )

    def __post_init__(self) -> None:
        if self.far_by not in FAR_BY:
            raise ValueError(f"detections.far_by is {self.far_by!r}, expected {', '.join(FAR_BY)}.")
        if self.boxes not in BOXES:
            raise ValueError(f"detections.boxes is {self.boxes!r}, expected {', '.join(BOXES)}.")
        if (self.width > 0) != (self.height > 0):
            raise ValueError(
                f"detections.width is {self.width} and height {self.height}, expected both or none."
            )
        if self.squeezed and not self.width:
            raise ValueError(
                "detections.squeezed is true, expected detections.width and height beside it."
            )


class DetectionWatch:
    """Makes sightings of what a detector says, by what ``camera_info`` says.

    Args:
        settings: see there.
        robot: whose LiDAR it is, and whose hull: nearer returns are its own parts.

    Raises:
        ValueError: there are no such labels, the robot has no ``camera_info``, or its file does not
            say where the LiDAR sits that is to tell distances; one sentence.
    """

    def __init__(self, settings: DetectionSettings, robot: Robot) -> None:
        lidar = robot.lidar
        if "camera_info" not in robot.topics:
            raise ValueError(
                f"The robot {robot.name} has no camera_info, by which boxes become directions: "
                "name its topic in the robot's file."
            )
        if settings.far_by == "lidar" and lidar.mount == "tf":
            raise ValueError(
                "detections.far_by is lidar, but the robot's file leaves where that sits to TF: "
                "say it there, or set detections.far_by to size."
            )
        self._settings, self._hull, self._frame = settings, robot.radius, lidar.frame
        mount = Mount(lidar.x, lidar.y, math.radians(lidar.yaw_deg))
        self._mount = mount.corrected(math.radians(lidar.bearing_bias_deg))
        self._labels = load_labels(settings.labels)
        self._sizes = by_size(known_sizes())
        self._scans: list[tuple[float, Scan]] = []
        self._fixed_tilt = math.radians(settings.tilt_deg)
        self._told = ToldCamera()
        self._camera: Pinhole | None = None
        self._fault = ""

    def unseen(self, goal: str) -> str:
        """Why the detector can never see a goal, as one sentence; "" when it can."""
        if goal in self._labels.categories_said:
            return ""
        return (
            f"The detector never says {goal}, as its labels {self._settings.labels} have no such "
            "class: ask for another goal, or set detections.labels to what it learnt."
        )

    def tell(self, camera: Pinhole, driving: bool = False) -> None:
        """Take what ``camera_info`` says.

        Args:
            camera: of the pictures that the detector is given.
            driving: then it may not change.
        """
        if self._told.tell(camera, driving):
            self._camera, self._fault = self._sized(camera)

    def _sized(self, camera: Pinhole) -> tuple[Pinhole, str]:
        """The camera in pictures of the size that was set, and what is wrong with it."""
        fov, (low, high) = camera.fov_deg, FOV_DEG
        inside = 0 <= camera.cx <= camera.width and 0 <= camera.cy <= camera.height
        if fov is None or not inside or not all(low <= angle <= high for angle in fov):
            return camera, (
                f"camera_info tells of {camera.width}x{camera.height} pixels with focal lengths "
                f"{camera.fx:g} and {camera.fy:g} and the middle at {camera.cx:g}, {camera.cy:g}, "
                "which is no view: calibrate the camera."
            )
        wide, tall = self._settings.width, self._settings.height
        if not wide:
            return camera, ""
        aspect = wide / tall / (camera.width / camera.height)
        if abs(aspect - 1) > ASPECT_TOLERANCE and not self._settings.squeezed:
            return camera, (
                f"The detector's picture is set to {wide}x{tall}, but camera_info tells of "
                f"{camera.width}x{camera.height}, another shape: name the camera_info of the "
                "picture that the detector is given, or set detections.squeezed where it is given "
                "all of this one."
            )
        return camera.scaled(wide, tall), ""

    def hear(self, stamp: float, scan: Scan) -> None:
        """Take a scan; one that makes no sense, or is another scanner's, tells no distance.

        Args:
            stamp: node time, seconds.
            scan: of the robot's LiDAR.
        """
        if not malformed(scan) and self._frame in ("", scan.frame):
            kept = [(at, of) for at, of in self._scans if abs(stamp - at) <= KEPT_S]
            self._scans = [*kept, (stamp, scan)]

    def see(self, stamp_ns: int, claims: Sequence[Claim], tilt: float) -> CameraFrame:
        """What a policy looks at.

        Args:
            stamp_ns: of the picture that the detector was given.
            claims: what it says of it.
            tilt: of the camera then, rad, up positive; NaN of one that cannot tilt.

        Returns:
            A frame of sightings, or one with a fault that another message will have as well, or
            one that waits for ``camera_info``.
        """
        camera = self._camera
        if camera is None:
            waiting = "Detections wait for camera_info, by which boxes become directions."
            return CameraFrame(stamp_ns, waiting=waiting)
        # none are no reason to take the detector for frozen: there may be nothing to see
        data = tuple(claims) or None
        frame = CameraFrame(stamp_ns, height=camera.height, width=camera.width, data=data)
        if fault := self._fault or self._told.changed:
            return replace(frame, fault=fault)
        try:
            at = tilt if math.isfinite(tilt) else self._fixed_tilt
            seen = tuple(self._seen(claims, camera, at, seconds(stamp_ns)))
        except ValueError as error:
            return replace(frame, fault=str(error))
        return replace(frame, decode=lambda every=1: seen)

    def _seen(
        self, claims: Sequence[Claim], camera: Pinhole, tilt: float, stamp: float
    ) -> list[Sighting]:
        far, seen = self._ranging(stamp), []
        for claim in claims:
            name, (box, depth) = self._name(claim), self._placed(claim, camera)
            if claim.score < self._settings.least:
                continue
            one = sighted(Detection(name, claim.score, box), camera, tilt, depth)
            seen.append(one if one.distance else replace(one, distance=far(one)))
        return seen

    def _name(self, claim: Claim) -> str:
        try:
            return self._labels.category(claim.class_id)
        except ValueError as error:
            raise ValueError(f"The labels do not fit the detector: {error}") from None

    def _placed(self, claim: Claim, camera: Pinhole) -> tuple[Box, float]:
        """Its box in the picture, pixels, and how far it is along the camera's axis; 0: unknown.

        Raises:
            ValueError: the box is of another picture, or has no place before this camera.
        """
        if self._settings.boxes == "pixels":
            return _within(claim.box, camera), claim.depth
        if camera.frame and claim.frame != camera.frame:
            raise ValueError(
                f"The detector's boxes are in {claim.frame or 'no frame'}, the camera's is "
                f"{camera.frame}: let the detector say them there."
            )
        if not 0 < claim.box_depth <= FURTHEST_M:  # nor nan
            raise ValueError(
                f"A box is {claim.box_depth:g} m before the camera, expected more than 0 and at "
                f"most {FURTHEST_M:g}, as detections.boxes is metres: set it to pixels, or name a "
                "Detection3DArray that has them."
            )
        left, top, right, bottom = (side / claim.box_depth for side in claim.box)
        x, y = camera.cx + 0.5, camera.cy + 0.5  # a box's edges lie between pixels
        box = (
            x + camera.fx * left, y + camera.fy * top,
            x + camera.fx * right, y + camera.fy * bottom,
        )  # fmt: skip
        return _within(box, camera), claim.box_depth

    def _ranging(self, stamp: float) -> Ranging:
        by, (least, most) = self._settings.far_by, SCAN_AGES_S
        if by == "size":
            return self._sizes
        for scanned, scan in reversed(self._scans):
            if by == "lidar" and least <= stamp - scanned <= most:
                x, y = points_around(scan, self._mount, self._hull).T
                return by_ranges(np.arctan2(y, x), np.hypot(x, y))
        return lambda _: 0.0


def _within(box: Box, camera: Pinhole) -> Box:
    """A box cut to the picture.

    Raises:
        ValueError: it must be of another picture; one sentence.
    """
    left, top, right, bottom = box
    wide, high = camera.width, camera.height
    inside = 0 <= left + right <= 2 * wide and 0 <= top + bottom <= 2 * high
    across, down = right - left, bottom - top
    if (
        not inside
        or max(across, down) < LEAST_PX
        or across > LARGEST * wide
        or down > LARGEST * high
    ):
        raise ValueError(
            f"A box reaches from {left:.1f}, {top:.1f} to {right:.1f}, {bottom:.1f} in a picture "
            f"of {wide}x{high} pixels: set detections.width and height to the size of the picture "
            "that the detector is given."
        )
    return max(left, 0), max(top, 0), min(right, wide), min(bottom, high)
