"""What a detector's messages mean, and which of them mean nothing."""

from __future__ import annotations

import math
from types import SimpleNamespace as Of

import numpy as np
import pytest
from cfnav_ros.drive.detection_watch import DetectionSettings, DetectionWatch
from cfnav_ros.drive.fields import MOST_DETECTIONS, Claim, detections_from_message
from cfnav_ros.lidar.returns import Scan

from cfnav_core.detect.sightings import known_sizes
from cfnav_core.robot.robot import Lidar, load_robot
from cfnav_core.task.camera import CAMERAS
from cfnav_core.task.pinhole import Pinhole

WIDE = Pinhole.of(CAMERAS["stock_wide"])
MIDDLE = Claim("41", 0.8, (200.0, 100.0, 248.0, 152.0))
NS = 5_000_000_000


def watch(camera: Pinhole | None = WIDE, lidar: Lidar | None = None, **said) -> DetectionWatch:
    settings = DetectionSettings(**{"labels": "coco", "far_by": "nothing", **said})
    return DetectionWatch(settings, camera, lidar or load_robot("turtlebot4").lidar, 0.175, 0.5)


def told_of(*detections, size=None) -> list[Claim]:
    """By way of a message; each is class, score, centre, extent and, in 3D, a position."""

    def one(name, score, x, y, wide, high, at=(0.0, 0.0, 0.0)):
        hypothesis = Of(class_id=name, score=score)
        position = Of(x=at[0], y=at[1], z=at[2])
        result = Of(hypothesis=hypothesis, pose=Of(pose=Of(position=position)))
        centre = Of(position=Of(x=x, y=y))
        if size == "3d":
            return Of(results=[result], bbox=Of(center=centre, size=Of(x=wide, y=high, z=0.01)))
        return Of(results=[result], bbox=Of(center=centre, size_x=wide, size_y=high))

    return detections_from_message(Of(detections=[one(*row) for row in detections]))


def test_a_class_by_number_or_name_becomes_a_goal_in_a_direction() -> None:
    for name in ("41", "cup"):
        frame = watch().see(NS, told_of((name, 0.8, 224.0, 126.0, 48.0, 52.0)), 0.0)
        (one,) = frame.decode()
        assert (one.name, one.confidence) == ("Mug", 0.8)
        assert (one.azimuth, one.elevation) == pytest.approx((0, 0), abs=1e-6)
        assert (frame.stamp_ns, frame.fault, one.distance) == (NS, "", 0)


def test_no_detection_is_a_frame_in_which_nothing_is_seen() -> None:
    assert watch().see(NS, [], 0.0).decode() == ()


def test_depthais_detections_in_space_have_boxes_in_pixels_and_distances_in_metres() -> None:
    (one,) = told_of(("41", 0.8, 100.0, 50.0, 20.0, 30.0, (0.5, 0.1, 1.2)), size="3d")
    assert one.box == (90.0, 35.0, 110.0, 65.0)
    assert one.distance == pytest.approx(math.hypot(0.5, 1.2))
    (seen,) = watch(far_by="size").see(NS, [one], 0.0).decode()
    assert seen.distance == one.distance


def test_the_picture_of_the_detector_may_be_of_another_size() -> None:
    """A detector that is given 300x300 of what camera_info says are 250x250."""
    square = Pinhole.of(CAMERAS["stock_preview"])
    (own,) = watch(square).see(NS, [Claim("41", 0.8, (100, 75, 150, 125))], 0.0).decode()
    larger = watch(square, width=300, height=300)
    (other,) = larger.see(NS, [Claim("41", 0.8, (120, 90, 180, 150))], 0.0).decode()
    assert other == own
    found = watch(square).see(NS, [Claim("41", 0.8, (260, 90, 290, 150))], 0.0).fault
    assert "picture of 250x250: set detections.width and height" in found


def test_a_class_that_the_labels_lack_is_a_fault() -> None:
    found = watch().see(NS, [MIDDLE, Claim("9999", 0.8, MIDDLE.box)], 0.0).fault
    assert "found the class '9999'" in found


@pytest.mark.parametrize(
    ("row", "why"),
    [
        (("41", math.nan, 5.0, 5.0, 4.0, 4.0), "score is nan, expected 0 to 1"),
        (("41", 1.7, 5.0, 5.0, 4.0, 4.0), r"score is 1\.7, expected 0 to 1"),
        (("41", 0.5, math.nan, 5.0, 4.0, 4.0), "number that is not finite"),
        (("41", 0.5, 5.0, 5.0, math.inf, 4.0), "number that is not finite"),
    ],
)
def test_numbers_that_make_no_sense_are_no_message(row: tuple, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        told_of(row)


def test_a_flood_is_no_message_and_what_has_no_extent_is_left_out() -> None:
    row = ("41", 0.5, 5.0, 5.0, 4.0, 4.0)
    assert len(told_of(*[row] * MOST_DETECTIONS)) == MOST_DETECTIONS
    with pytest.raises(ValueError, match="501 detections, expected 500 at most"):
        told_of(*[row] * (MOST_DETECTIONS + 1))
    assert told_of(("41", 0.5, 5.0, 5.0, 0.0, 4.0)) == []
    assert detections_from_message(Of(detections=[Of(results=[], bbox=None)])) == []


def test_boxes_wait_for_camera_info_and_follow_it() -> None:
    of = watch(None)
    with pytest.raises(ValueError, match="wait for camera_info"):
        of.see(NS, [MIDDLE], 0.0)
    of.tell(Pinhole(0.0, 0.0, 0.0, 0.0, 448, 252))  # nobody calibrated it
    with pytest.raises(ValueError, match="wait for camera_info"):
        of.see(NS, [MIDDLE], 0.0)
    of.tell(WIDE)
    assert of.see(NS, [MIDDLE], 0.0).decode() == watch().see(NS, [MIDDLE], 0.0).decode()


def test_the_cameras_tilt_is_in_the_direction() -> None:
    (one,) = watch().see(NS, [Claim("41", 0.8, (200.0, 100.0, 248.0, 152.0))], -0.5).decode()
    assert one.elevation == pytest.approx(-0.5, abs=1e-6)


def test_distance_by_size_is_that_of_the_shipped_sizes() -> None:
    (one,) = watch(far_by="size").see(NS, [MIDDLE], 0.0).decode()
    wide, high = known_sizes()["Mug"]
    by_both = wide / (2 * math.tan(one.width / 2)), high / (2 * math.tan(one.height / 2))
    assert one.distance == pytest.approx(min(by_both))


def scan(ranges: np.ndarray) -> Scan:
    return Scan(ranges.astype(np.float32), -math.pi, math.pi, math.tau / len(ranges), 0.15, 12.0)


def test_distance_by_the_lidar_is_what_stands_in_the_direction_of_the_box() -> None:
    of = watch(far_by="lidar")
    assert of.see(NS, [MIDDLE], 0.0).decode()[0].distance == 0  # no scan yet
    ranges = np.full(720, 3.0)
    ahead = np.abs(np.arange(720) / 2 - 180 + 90) < 4  # forward is -90 degrees of the laser's
    ranges[ahead] = 1.24
    ranges[::50] = np.nan
    of.hear(NS * 1e-9 - 0.2, scan(ranges))
    (one,) = of.see(NS, [MIDDLE], 0.0).decode()
    assert one.distance == pytest.approx(1.2, abs=0.01)  # the laser sits 4 cm behind the middle
    left = Claim("41", 0.8, (10.0, 100.0, 50.0, 152.0))
    assert of.see(NS, [left], 0.0).decode()[0].distance == pytest.approx(3.0, abs=0.05)
    assert of.see(NS + 2_000_000_000, [MIDDLE], 0.0).decode()[0].distance == 0  # of long ago


def test_settings_that_contradict_are_refused() -> None:
    with pytest.raises(ValueError, match="expected both or none"):
        DetectionSettings(width=300)
    with pytest.raises(ValueError, match=r"far_by is 'sonar', expected lidar, size, nothing"):
        DetectionSettings(far_by="sonar")
    with pytest.raises(ValueError, match="found no labels 'mine'"):
        watch(labels="mine")
