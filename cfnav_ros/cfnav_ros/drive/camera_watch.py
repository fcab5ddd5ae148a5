"""What of a robot's pictures the camera that a policy learnt from would show. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from cfnav_core.task.camera import ASPECT_TOLERANCE, FOV_TOLERANCE_DEG, CameraSetUp
from cfnav_core.task.pinhole import Pinhole
from cfnav_ros.drive.inputs import CameraFrame


@dataclass(frozen=True)
class Crop:
    """Part of a picture, as shares of its width and height from its upper left corner."""

    left: float = 0.0
    top: float = 0.0
    right: float = 1.0
    bottom: float = 1.0

    def of(self, rgb: np.ndarray) -> np.ndarray:
        """That part of a picture [H, W, 3]."""
        rows, columns = self.within(*rgb.shape[:2])
        return rgb[rows, columns]

    def within(self, height: int, width: int) -> tuple[slice, slice]:
        """Its rows and columns in a picture of a size, pixels."""
        return (
            slice(round(self.top * height), round(self.bottom * height)),
            slice(round(self.left * width), round(self.right * width)),
        )


WHOLE = Crop()

CHANGED = "camera_info speaks of another camera than before: end one of the two."


class ToldCamera:
    """The camera that ``camera_info`` tells of, which may not change while the robot drives.

    Attributes:
        camera: of the last word that was taken; None before the first.
        changed: ``CHANGED`` once it spoke of another in a drive, until one ends; else empty.
    """

    def __init__(self) -> None:
        self.camera: Pinhole | None = None
        self.changed = ""

    def tell(self, found: Pinhole, driving: bool) -> bool:
        """Take a word, unless one was taken and the robot drives; whether it is a new one."""
        # as text: a camera that nobody calibrated may say nan, which is never itself
        new = repr(found) != repr(self.camera)
        if driving and self.camera is not None:
            self.changed = self.changed or CHANGED * new
            return False
        self.camera, self.changed = found, ""
        return new


def fitting(learnt: CameraSetUp, found: Pinhole) -> Crop | None:
    """The part of a robot's pictures that a policy's camera would show, None when there is none.

    Pictures of one field of view and shape are taken whole, and so are those of a camera that
    nobody calibrated. Of others the part around the camera's axis that has the policy's field of
    view; where a picture ends before that by no more than ``FOV_TOLERANCE_DEG``, the largest part
    of that shape. Perception then averages it to its size.

    Args:
        learnt: the policy's camera.
        found: the robot's.
    """
    fov = found.fov_deg
    if fov is None or not learnt.differs(fov, (found.width, found.height)):
        return WHOLE
    x, y = found.cx + 0.5, found.cy + 0.5
    across, down = (math.tan(math.radians(v) / 2) for v in learnt.fov_deg)
    reach_x = min(x, found.width - x) / found.fx
    reach_y = min(y, found.height - y) / found.fy
    share = min(1.0, reach_x / across, reach_y / down)
    seen = (math.degrees(2 * math.atan(share * half)) for half in (across, down))
    if any(own - v > FOV_TOLERANCE_DEG for own, v in zip(learnt.fov_deg, seen, strict=True)):
        return None
    dx, dy = share * across * found.fx, share * down * found.fy
    return Crop(
        (x - dx) / found.width, (y - dy) / found.height,
        (x + dx) / found.width, (y + dy) / found.height,
    )  # fmt: skip


def other_camera(learnt: CameraSetUp, found: Pinhole) -> str:
    """One sentence when no part of a robot's pictures is what a policy learnt from, else empty.

    Args:
        learnt: the policy's camera.
        found: the robot's.
    """
    fov = found.fov_deg
    if fov is None or fitting(learnt, found) is not None:
        return ""
    return (
        f"The robot's camera shows {learnt.differs(fov, (found.width, found.height))} by its "
        f"camera_info, but the bundle learnt from {learnt}: choose a bundle of this camera, or set "
        "other_camera to drive all the same."
    )


class CameraWatch:
    """Gives of each picture what the policy's camera would show, by what ``camera_info`` says."""

    def __init__(self, learnt: CameraSetUp | None, told: bool, any_camera: bool = False) -> None:
        """Begin without a word of the camera.

        Args:
            learnt: the policy's camera; None when nobody said, and then every picture is whole.
            told: whether ``camera_info`` is heard; if not, every picture is whole, too.
            any_camera: pictures in which the policy's view is not are whole and no fault.
        """
        self._any_camera = any_camera
        self._learnt = learnt if told else None
        self._told = ToldCamera()
        self._crop: Crop | None = WHOLE
        self._fault = ""

    def tell(self, found: Pinhole, driving: bool = False) -> None:
        """Take what ``camera_info`` says; while the robot drives that may not change."""
        if self._learnt is None or not self._told.tell(found, driving):
            return
        self._crop = fitting(self._learnt, found)
        self._fault = other_camera(self._learnt, found)
        if self._any_camera and self._crop is None:
            self._crop = WHOLE

    def see(self, frame: CameraFrame) -> CameraFrame:
        """The frame with what the policy's camera would show, or with its fault.

        Raises:
            ValueError: it has another shape, and only ``camera_info`` can tell which part of it is
                wanted; one sentence.
        """
        learnt, found, crop = self._learnt, self._told.camera, self._crop
        if learnt is None or frame.fault:
            return frame
        if found is None:
            if not _shaped(frame, learnt.size):
                raise ValueError(
                    f"A picture of {frame.width}x{frame.height} waits for its camera_info, by "
                    f"which it is cut to the view that the bundle learnt from ({learnt})."
                )
            return frame
        if crop is None or self._told.changed:
            return replace(frame, fault=self._told.changed or self._fault)
        if crop is WHOLE:
            return frame
        if not _shaped(frame, (found.width, found.height)):
            return replace(
                frame,
                fault=f"The picture is {frame.width}x{frame.height}, but its camera_info speaks of "
                f"{found.width}x{found.height}: set the camera driver so that it tells of its own.",
            )
        rows, columns = crop.within(frame.height, frame.width)
        return replace(
            frame,
            decode=lambda every=1: crop.of(frame.decode(every)),
            height=rows.stop - rows.start,
            width=columns.stop - columns.start,
        )


def _shaped(frame: CameraFrame, size: tuple[int, int]) -> bool:
    """Whether a frame has the shape of pictures of a width and height."""
    aspect = frame.width / max(frame.height, 1)
    return abs(aspect / (size[0] / size[1]) - 1) <= ASPECT_TOLERANCE
