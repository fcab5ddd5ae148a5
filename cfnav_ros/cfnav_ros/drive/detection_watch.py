"""What a detector's messages mean: which goals are seen in which directions, and how far. Pure."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from cfnav_core.detect.labels import LabelMap, load_labels
from cfnav_core.detect.sightings import Ranging, Sighting, by_ranges, by_size, known_sizes, sighted
from cfnav_core.perception.boxes import Box, Detection
from cfnav_core.robot.robot import Lidar, Robot
from cfnav_core.robot.settings import setting
from cfnav_core.task.pinhole import Pinhole
from cfnav_ros.drive.fields import Claim
from cfnav_ros.drive.inputs import CameraFrame
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.lidar.returns import Mount, Scan
from cfnav_ros.robot.stamps import seconds

MOCK_LABELS = "cfnav"
"""By whose numbers the mock's detector says what it knows."""

FAR_BY = ("lidar", "size", "nothing")

SETTLED_S, KEPT_SCANS = 0.1, 10
"""A scan is asked about pictures this much later than it on, so that it has come whatever the order
of messages is, and a recorded drive is judged as it was driven."""


@dataclass(frozen=True)
class DetectionSettings:
    """How the policy takes what a detector says."""

    labels: str = setting(
        "coco", "what it learnt: cfnav, coco, coco_ids, voc, objects365 or a file of names"
    )
    width: int = setting(0, "of the picture its boxes are in, pixels; 0: camera_info's", 0, 10000)
    height: int = setting(0, "the same of its height", 0, 10000)
    far_by: Literal["lidar", "size", "nothing"] = setting(
        "lidar",
        "how far a thing is that it says nothing of: lidar (what is in its direction), size (how "
        "large such things are) or nothing",
    )

    def __post_init__(self) -> None:
        if self.far_by not in FAR_BY:
            raise ValueError(f"detections.far_by is {self.far_by!r}, expected {', '.join(FAR_BY)}.")
        if (self.width > 0) != (self.height > 0):
            raise ValueError(
                f"detections.width is {self.width} and height {self.height}, expected both or none."
            )


class DetectionWatch:
    """Makes sightings of what a detector says, by what ``camera_info`` says.

    Args:
        settings: see there.
        camera: where nobody publishes ``camera_info``; None: it is waited for.
        lidar: where it sits.
        hull: radius of the robot, metres: nearer returns are its own parts.
        scan_age: by which a scan may be older than the picture that it is asked about, seconds.

    Raises:
        ValueError: there are no such labels.
    """

    def __init__(
        self, settings: DetectionSettings, camera: Pinhole | None, lidar: Lidar, hull: float,
        scan_age: float,
    ) -> None:  # fmt: skip
        self._settings, self._hull = settings, hull
        mount = Mount(lidar.x, lidar.y, math.radians(lidar.yaw_deg))
        self._mount = mount.corrected(math.radians(lidar.bearing_bias_deg))
        self._scan_age = scan_age
        self.labels: LabelMap = load_labels(settings.labels)
        self._camera = self._sized(camera) if camera else None
        self._sizes = by_size(known_sizes())
        self._scans: deque[tuple[float, Scan]] = deque(maxlen=KEPT_SCANS)

    def _sized(self, camera: Pinhole) -> Pinhole:
        wide, high = self._settings.width, self._settings.height
        return camera.scaled(wide, high) if wide else camera

    def tell(self, camera: Pinhole) -> None:
        """Take what ``camera_info`` says; one that says nothing usable is passed over."""
        if camera.fov_deg is not None:
            self._camera = self._sized(camera)

    def hear(self, stamp: float, scan: Scan) -> None:
        """Take a scan.

        Args:
            stamp: node time, seconds.
            scan: of the robot's LiDAR.
        """
        self._scans.append((stamp, scan))

    def _by(self, scan: Scan) -> Ranging:
        ranges = scan.ranges
        usable = np.isfinite(ranges) & (ranges >= scan.range_min) & (ranges <= scan.range_max)
        angle = scan.angle_min + scan.angle_increment * np.flatnonzero(usable)
        bearing = self._mount.bearings(angle)
        x = self._mount.x + ranges[usable] * np.cos(bearing)
        y = self._mount.y + ranges[usable] * np.sin(bearing)
        away = np.hypot(x, y)
        other = away > self._hull
        return by_ranges(np.arctan2(y, x)[other], away[other])

    def see(self, stamp_ns: int, told: Sequence[Claim], tilt: float) -> CameraFrame:
        """What a policy looks at.

        Args:
            stamp_ns: of the picture that the detector was given.
            told: what it says of it.
            tilt: of the camera then, rad, up positive.

        Returns:
            A frame of sightings, or one with a fault that another message will have as well.

        Raises:
            ValueError: the camera is not known yet; one sentence.
        """
        camera = self._camera
        if camera is None:
            raise ValueError("Detections wait for camera_info, by which boxes become directions.")
        size = camera.height, camera.width
        try:
            found = [self._found(one, camera) for one in told]
        except ValueError as error:
            return CameraFrame(stamp_ns, height=size[0], width=size[1], fault=str(error))
        far = self._ranging(seconds(stamp_ns))
        seen = [sighted(one, camera, tilt) for one in found]
        known = tuple(
            replace(one, distance=said.distance or far(one))
            for one, said in zip(seen, told, strict=True)
        )
        return CameraFrame(stamp_ns, lambda every=1: known, *size)

    def _found(self, one: Claim, camera: Pinhole) -> Detection:
        box = _within(one.box, camera)
        return Detection(self.labels.category(one.class_id), one.score, box)

    def _ranging(self, stamp: float) -> Ranging:
        by = self._settings.far_by
        if by == "lidar":
            ages = [(stamp - scanned, scan) for scanned, scan in self._scans]
            for age, scan in sorted(ages, key=lambda pair: pair[0]):
                if SETTLED_S <= age <= self._scan_age:
                    return self._by(scan)
        return self._sizes if by == "size" else _unknown


def watch_of(
    settings: DetectionSettings, robot: Robot, limits: EpisodeLimits, camera: Pinhole | None = None
) -> DetectionWatch:
    """The watch of a robot; ``camera``: see there."""
    return DetectionWatch(settings, camera, robot.lidar, robot.radius, limits.ages.estimate)


def _unknown(_: Sighting) -> float:
    return 0.0


def _within(box: Box, camera: Pinhole) -> Box:
    """A box cut to the picture.

    Raises:
        ValueError: its middle is not in the picture, which must be another one; one sentence.
    """
    left, top, right, bottom = box
    x, y = (left + right) / 2, (top + bottom) / 2
    if not (0 <= x <= camera.width and 0 <= y <= camera.height):
        raise ValueError(
            f"A box lies at {x:.0f}, {y:.0f} of a picture of {camera.width}x{camera.height}: set "
            "detections.width and height to the size of the picture that the detector is given."
        )
    return max(left, 0), max(top, 0), min(right, camera.width), min(bottom, camera.height)
