"""What a live node would have decided on at a moment of a bag, by its own rule of ages. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace

from cfnav_ros.bags.files.events import Judged, Picture
from cfnav_ros.bags.replay.kept_pictures import KeptPictures
from cfnav_ros.drive.inputs import CameraFrame, SensorInputs, StampedEstimate, input_complaint
from cfnav_ros.drive.limits import EpisodeLimits


@dataclass(frozen=True)
class ReplayView:
    """The newest picture and estimate at a node time.

    Attributes:
        t_ns: node time.
        picture: None before the first.
        estimate: None before the first, or when the LiDAR is not used.
        complaint: why nothing would be decided on them, one sentence; empty when they can be used.
    """

    t_ns: int
    picture: Picture | None
    estimate: Judged | None
    complaint: str


def view(
    now_ns: int,
    pictures: KeptPictures,
    newest: tuple[int, Judged | None],
    limits: EpisodeLimits,
) -> ReplayView:
    """Look at what is newest.

    Args:
        now_ns: node time.
        pictures: those of late.
        newest: node time at which the newest estimate came, and the estimate.
        limits: the ages, and whether the LiDAR is used.
    """
    came_ns, picture = pictures.newest
    published_ns, estimate = newest if limits.lidar else (0, None)
    inputs, arrived = SensorInputs(), {}
    if picture is not None:
        inputs, arrived["frame"] = replace(inputs, frame=CameraFrame(picture.t_ns)), came_ns * 1e-9
    if estimate is not None:
        made = StampedEstimate(estimate.t_ns, estimate.estimate)
        inputs, arrived["estimate"] = replace(inputs, estimate=made), published_ns * 1e-9
    inputs = replace(inputs, arrived=arrived)
    names = ("frame", "estimate") if limits.lidar else ("frame",)
    found = [
        input_complaint(now_ns * 1e-9, inputs, name, getattr(limits.ages, name)) for name in names
    ]
    text = "; ".join(filter(None, found))
    return ReplayView(now_ns, picture, estimate, f"{text[0].upper()}{text[1:]}." if text else "")
