"""What a detector's messages mean, and which of them mean nothing."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace as Of

import numpy as np
import pytest
from cfnav_ros.drive.detection_watch import DetectionSettings, DetectionWatch
from cfnav_ros.drive.fields import MOST_DETECTIONS, Claim, detections_from_message
from cfnav_ros.lidar.returns import Scan

from cfnav_core.detect.detector import MOST
from cfnav_core.detect.sightings import known_sizes
from cfnav_core.perception.boxes import Box
from cfnav_core.robot.robot import Robot, load_robot
from cfnav_core.task.camera import CAMERAS, MAST
from cfnav_core.task.pinhole import Pinhole

WIDE = Pinhole.of(CAMERAS["stock_wide"])
MIDDLE = Claim("41", 0.8, (200.0, 100.0, 248.0, 152.0))
NS = 5_000_000_000
ROBOT = load_robot("turtlebot4")


def watch(camera: Pinhole | None = WIDE, robot: Robot = ROBOT, **said) -> DetectionWatch:
    made = DetectionWatch(
        DetectionSettings(**{"labels": "coco", "far_by": "nothing", **said}), robot
    )
    if camera:
        made.tell(camera)
    return made


def told_of(*detections, size=None) -> list[Claim]:
    """By way of a message; each is class, score, centre, extent and, in 3D, a position."""

    def one(name, score, x, y, wide, high, at=(0.0, 0.0, 0.0), ahead=0.0):
        hypothesis = Of(class_id=name, score=score)
        position = Of(x=at[0], y=at[1], z=at[2])
        result = Of(hypothesis=hypothesis, pose=Of(pose=Of(position=position)))
        unturned = Of(x=0.0, y=0.0, z=0.0, w=0.0)
        centre = Of(position=Of(x=x, y=y, z=ahead), theta=0.0, orientation=unturned)
        if size == "3d":
            return Of(results=[result], bbox=Of(center=centre, size=Of(x=wide, y=high, z=0.01)))
        return Of(results=[result], bbox=Of(center=centre, size_x=wide, size_y=high))

    header = Of(frame_id="oakd_optical")
    return detections_from_message(Of(header=header, detections=[one(*row) for row in detections]))


def test_a_class_by_number_or_name_becomes_a_goal_in_a_direction() -> None:
    for name in ("41", "cup"):
        frame = watch().see(NS, told_of((name, 0.8, 224.0, 126.0, 48.0, 52.0)), 0.0)
        (one,) = frame.decode()
        assert (one.name, one.confidence) == ("Mug", 0.8)
        assert (one.azimuth, one.elevation) == pytest.approx((0, 0), abs=1e-6)
        assert (frame.stamp_ns, frame.fault, one.distance) == (NS, "", 0)


def test_no_detection_is_a_frame_in_which_nothing_is_seen() -> None:
    assert watch().see(NS, [], 0.0).decode() == ()


@pytest.mark.parametrize("tilt", [0.0, -math.radians(30.0)])
def test_depthais_detections_in_space_tell_how_far_things_are_along_the_floor(tilt: float) -> None:
    """Boxes in pixels, metres along the axis of a camera that may look down."""
    mast, ahead, left, down = Pinhole.of(MAST), 1.2, 0.4, 0.9
    depth = ahead * math.cos(tilt) - down * math.sin(tilt)
    rise = -down * math.cos(tilt) - ahead * math.sin(tilt)
    u = mast.cx + 0.5 - mast.fx * left / depth
    v = mast.cy + 0.5 - mast.fy * rise / depth
    (one,) = told_of(("41", 0.8, u, v, 20.0, 30.0, (9.0, 9.0, depth)), size="3d")
    assert one.box == pytest.approx((u - 10, v - 15, u + 10, v + 15))
    (seen,) = watch(mast, far_by="size").see(NS, [one], tilt).decode()
    assert seen.distance == pytest.approx(math.hypot(ahead, left))


def test_the_picture_of_the_detector_may_be_of_another_size() -> None:
    """A detector that is given 300x300 of what camera_info says are 250x250."""
    square = Pinhole.of(CAMERAS["stock_preview"])
    (own,) = watch(square).see(NS, [Claim("41", 0.8, (100, 75, 150, 125))], 0.0).decode()
    larger = watch(square, width=300, height=300)
    (other,) = larger.see(NS, [Claim("41", 0.8, (120, 90, 180, 150))], 0.0).decode()
    assert other == own


@pytest.mark.parametrize(
    "box",
    [
        (460.0, 90.0, 520.0, 150.0), (-1e5, -1e5, 1e5, 1e5), (0.45, 0.45, 0.55, 0.55),
        (-400.0, 100.0, 600.0, 160.0), (600.0, 480.0, 1040.0, 800.0),
    ],
)  # fmt: skip
def test_a_box_of_another_picture_is_a_fault(box: Box) -> None:
    found = watch().see(NS, [MIDDLE, Claim("41", 0.8, box)], 0.0)
    assert "in a picture of 448x252 pixels: set detections.width and height" in found.fault
    with pytest.raises(ValueError, match="No picture"):
        found.decode()


@pytest.mark.parametrize(
    ("box", "cut"),
    [
        ((-10.0, 100.0, 30.0, 152.0), (0.0, 100.0, 30.0, 152.0)),
        ((300.0, -60.0, 560.0, 300.0), (300.0, 0.0, 448.0, 252.0)),
    ],
)
def test_a_detector_may_say_how_far_a_thing_reaches_beyond_the_picture(box: Box, cut: Box) -> None:
    (one,) = watch().see(NS, [Claim("41", 0.8, box)], 0.0).decode()
    assert one == watch().see(NS, [Claim("41", 0.8, cut)], 0.0).decode()[0]


def test_a_sliver_at_the_edge_is_a_thing() -> None:
    (one,) = watch().see(NS, [Claim("41", 0.8, (447.2, 100.0, 447.9, 160.0))], 0.0).decode()
    assert 0 < one.width < 0.01 < one.height


@pytest.mark.parametrize(
    "camera",
    [
        Pinhole(0.0, 0.0, 0.0, 0.0, 448, 252), Pinhole(1.0, 1.0, 0.0, 0.0, 448, 252),
        Pinhole(1e-308, 1e-308, 223.5, 125.5, 448, 252), replace(WIDE, cx=math.nan),
        replace(WIDE, cx=4000.0),
    ],
)  # fmt: skip
def test_a_camera_info_that_is_no_view_is_a_fault(camera: Pinhole) -> None:
    assert "which is no view: calibrate" in watch(camera).see(NS, [MIDDLE], 0.0).fault


def test_the_size_of_the_detectors_picture_has_the_shape_of_camera_info() -> None:
    found = watch(width=416, height=416).see(NS, [MIDDLE], 0.0).fault
    assert "set to 416x416, but camera_info tells of 448x252, another shape" in found
    assert "or set detections.squeezed" in found


def test_boxes_of_a_squeezed_picture_lie_where_those_of_the_whole_one_do() -> None:
    whole = Claim("56", 0.8, (112.0, 63.0, 224.0, 189.0))
    across, down = 416 / 448, 416 / 252
    left, top, right, bottom = whole.box
    squeezed = replace(whole, box=(left * across, top * down, right * across, bottom * down))
    expected = watch().see(NS, [whole], 0.0).decode()
    found = watch(width=416, height=416, squeezed=True).see(NS, [squeezed], 0.0).decode()
    for one, same in zip(found, expected, strict=True):
        assert (one.azimuth, one.elevation) == pytest.approx((same.azimuth, same.elevation))
        assert (one.width, one.height) == pytest.approx((same.width, same.height))


def test_the_camera_does_not_change_during_a_drive() -> None:
    of, other = watch(), replace(WIDE, fx=WIDE.fx + 1)
    of.tell(WIDE, driving=True)
    assert not of.see(NS, [MIDDLE], 0.0).fault
    of.tell(other, driving=True)
    of.tell(WIDE, driving=True)
    assert "another camera than before" in of.see(NS, [MIDDLE], 0.0).fault
    of.tell(other)  # between drives its driver may have been started again
    assert of.see(NS, [MIDDLE], 0.0).decode() == watch(other).see(NS, [MIDDLE], 0.0).decode()


def test_a_camera_that_is_no_view_is_told_so_again_and_again() -> None:
    of = watch(replace(WIDE, cx=math.nan))
    of.tell(replace(WIDE, cx=math.nan), driving=True)
    assert "the middle at nan, 125.5, which is no view" in of.see(NS, [MIDDLE], 0.0).fault


def test_it_knows_what_the_detector_can_never_say() -> None:
    assert watch().unseen("Mug") == ""  # a cup to COCO
    assert watch().unseen("Towel").startswith("The detector never says Towel, as its labels coco")
    assert watch(labels="cfnav").unseen("Towel") == ""


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
        (("41", 0.5, 5.0, 5.0, -4.0, 4.0), "expected no negative numbers"),
    ],
)
def test_numbers_that_make_no_sense_are_no_message(row: tuple, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        told_of(row)


def test_what_is_further_away_than_any_room_is_large_is_no_message() -> None:
    with pytest.raises(ValueError, match=r"1e\+06 m away"):
        told_of(("41", 0.5, 5.0, 5.0, 4.0, 4.0, (0.0, 0.0, 1e6)), size="3d")


def test_every_score_of_a_detection_is_looked_at_and_a_turned_box_is_no_message() -> None:
    position = Of(position=Of(x=0.0, y=0.0, z=0.0))
    results = [Of(hypothesis=Of(class_id="41", score=score), pose=Of(pose=position))
               for score in (0.5, math.nan)]  # fmt: skip
    centre = Of(position=Of(x=5.0, y=5.0), theta=0.0)
    bbox = Of(center=centre, size_x=4.0, size_y=4.0)
    message = Of(header=Of(frame_id=""), detections=[Of(results=results, bbox=bbox)])
    with pytest.raises(ValueError, match="score is nan"):
        detections_from_message(message)
    del results[1]
    assert len(detections_from_message(message)) == 1
    centre.theta = 0.3
    with pytest.raises(ValueError, match=r"turned by 0\.3 rad, expected upright"):
        detections_from_message(message)


@pytest.mark.parametrize(
    ("turn", "upright"),
    [((0.0, 0.0, 0.0, 0.0), True), ((0.0, 0.0, 0.0, 1.0), True), ((0.0, 0.0, 0.6, 0.8), False)],
)
def test_a_turned_box_in_space_is_no_message(turn: tuple, upright: bool) -> None:
    result = Of(hypothesis=Of(class_id="41", score=0.5),
                pose=Of(pose=Of(position=Of(x=0.0, y=0.0, z=1.0))))  # fmt: skip
    x, y, z, w = turn
    centre = Of(position=Of(x=5.0, y=5.0, z=1.0), orientation=Of(x=x, y=y, z=z, w=w))
    box = Of(center=centre, size=Of(x=4.0, y=8.0, z=0.01))
    message = Of(header=Of(frame_id=""), detections=[Of(results=[result], bbox=box)])
    if upright:
        assert detections_from_message(message)[0].box == (3.0, 1.0, 7.0, 9.0)
        return
    with pytest.raises(ValueError, match=r"turned by the quaternion 0, 0, 0\.6, 0\.8"):
        detections_from_message(message)


def test_our_own_detector_says_no_more_than_is_taken() -> None:
    assert MOST <= MOST_DETECTIONS


def test_what_scores_less_than_a_policy_knows_does_not_count() -> None:
    rows = [("41", score, 224.0, 126.0, 48.0, 52.0) for score in (0.02, 0.29, 0.31)]
    assert [one.confidence for one in watch().see(NS, told_of(*rows), 0.0).decode()] == [0.31]
    assert len(watch(least=0.0).see(NS, told_of(*rows), 0.0).decode()) == 3
    odd = Claim("9999", 0.1, MIDDLE.box)
    assert (
        "found the class '9999'" in watch().see(NS, [odd], 0.0).fault
    )  # wrong labels all the same


def test_boxes_in_metres_are_where_they_stand_in_the_cameras_frame() -> None:
    camera = replace(WIDE, frame="oakd_optical")
    chair = ("56", 0.8, 0.6, 0.3, 1.1, 1.2, (0.6, 0.3, 2.0), 2.0)
    (one,) = watch(camera, boxes="metres").see(NS, told_of(chair, size="3d"), 0.0).decode()
    assert one.azimuth == pytest.approx(math.atan2(0.6, 2.0), abs=0.02)
    assert one.distance == pytest.approx(math.hypot(0.6, 2.0), abs=0.1)
    left = ("56", 0.8, -0.6, 0.0, 0.4, 0.4, (0.0, 0.0, 0.0), 2.0)
    (one,) = watch(camera, boxes="metres").see(NS, told_of(left, size="3d"), 0.0).decode()
    assert one.azimuth == pytest.approx(-math.atan2(0.6, 2.0), abs=0.02)
    other = replace(camera, frame="base_link")
    found = watch(other, boxes="metres").see(NS, told_of(chair, size="3d"), 0.0)
    assert "boxes are in oakd_optical, the camera's is base_link" in found.fault
    flat = watch(camera, boxes="metres").see(NS, told_of(chair[:6]), 0.0)
    assert "A box is 0 m before the camera" in flat.fault
    for ahead in (-1.0, 51.0, math.nan):
        odd = told_of((*chair[:-1], ahead), size="3d")
        assert "m before the camera" in watch(camera, boxes="metres").see(NS, odd, 0.0).fault
        assert watch(camera).see(NS, odd, 0.0).decode()  # of pixels it says nothing
    with pytest.raises(ValueError, match="boxes is 'feet', expected pixels, metres"):
        DetectionSettings(boxes="feet")


def test_a_flood_is_no_message_and_what_has_no_extent_is_left_out() -> None:
    row = ("41", 0.5, 5.0, 5.0, 4.0, 4.0)
    assert len(told_of(*[row] * MOST_DETECTIONS)) == MOST_DETECTIONS
    with pytest.raises(ValueError, match="501 detections, expected 500 at most"):
        told_of(*[row] * (MOST_DETECTIONS + 1))
    assert told_of(("41", 0.5, 5.0, 5.0, 0.0, 4.0)) == []
    assert detections_from_message(Of(detections=[Of(results=[], bbox=None)])) == []


def test_boxes_wait_for_camera_info() -> None:
    of = watch(None)
    assert "wait for camera_info" in of.see(NS, [MIDDLE], 0.0).waiting
    of.tell(WIDE)
    assert of.see(NS, [MIDDLE], 0.0).decode() == watch().see(NS, [MIDDLE], 0.0).decode()


def test_the_cameras_tilt_is_in_the_direction() -> None:
    (one,) = watch().see(NS, [Claim("41", 0.8, (200.0, 100.0, 248.0, 152.0))], -0.5).decode()
    assert one.elevation == pytest.approx(-0.5, abs=1e-6)
    fixed = watch(tilt_deg=math.degrees(-0.5)).see(NS, [MIDDLE], math.nan)
    assert fixed.decode() == (one,)
    (level,) = watch().see(NS, [MIDDLE], math.nan).decode()
    assert level.elevation == pytest.approx(0, abs=1e-6)


def test_distance_by_size_is_that_of_the_shipped_sizes() -> None:
    (one,) = watch(far_by="size").see(NS, [MIDDLE], 0.0).decode()
    wide, high = known_sizes()["Mug"]
    by_both = wide / (2 * math.tan(one.width / 2)), high / (2 * math.tan(one.height / 2))
    assert one.distance == pytest.approx(min(by_both))


def scan(ranges: np.ndarray, frame: str = "rplidar_link") -> Scan:
    step = math.tau / len(ranges)
    return Scan(ranges.astype(np.float32), -math.pi, math.pi - step, step, 0.15, 12.0, frame)


def test_distance_by_the_lidar_is_what_stands_in_the_direction_of_the_box() -> None:
    of = watch(far_by="lidar")
    assert of.see(NS, [MIDDLE], 0.0).decode()[0].distance == 0  # no scan yet
    ranges = np.full(720, 3.0)
    ahead = np.abs(np.arange(720) / 2 - 180 + 90) < 4  # forward is -90 degrees of the laser's
    ranges[ahead] = 1.24
    ranges[::50] = np.nan
    ranges[177:179] = 0.17  # a part of its own
    taken = NS * 1e-9 - 0.3
    of.hear(taken, scan(ranges))
    of.hear(taken + 0.2, scan(ranges / 2))  # not sure to have come
    of.hear(taken, scan(ranges / 2, "another"))
    of.hear(taken, replace(scan(ranges / 2), angle_increment=0.0))
    (one,) = of.see(NS, [MIDDLE], 0.0).decode()
    assert one.distance == pytest.approx(1.2, abs=0.01)  # the laser sits 4 cm behind the middle
    left = Claim("41", 0.8, (10.0, 100.0, 50.0, 152.0))
    assert of.see(NS, [left], 0.0).decode()[0].distance == pytest.approx(3.0, abs=0.05)
    assert of.see(NS + 1_000_000_000, [MIDDLE], 0.0).decode()[0].distance == 0  # of long ago


@pytest.mark.parametrize("hz", [5.0, 7.5, 20.0, 40.0])
@pytest.mark.parametrize("late", [0.1, 1.0, 9.9])
def test_distance_by_the_lidar_is_known_however_late_boxes_and_fast_scans_come(
    hz: float, late: float
) -> None:
    of = watch(far_by="lidar")
    for k in reversed(range(int(12 * hz))):
        of.hear(NS * 1e-9 + late - k / hz, scan(np.full(720, 1.24)))
    assert of.see(NS, [MIDDLE], 0.0).decode()[0].distance == pytest.approx(1.2, abs=0.01)


def test_what_the_robot_does_not_tell_is_refused() -> None:
    without = {role: topic for role, topic in ROBOT.topics.items() if role != "camera_info"}
    with pytest.raises(ValueError, match="turtlebot4 has no camera_info"):
        watch(robot=replace(ROBOT, topics=without))
    by_tf = replace(ROBOT, lidar=replace(ROBOT.lidar, mount="tf"))
    with pytest.raises(ValueError, match="leaves where that sits to TF"):
        watch(robot=by_tf, far_by="lidar")
    assert watch(robot=by_tf, far_by="size").see(NS, [MIDDLE], 0.0).decode()


def test_settings_that_contradict_are_refused() -> None:
    with pytest.raises(ValueError, match="expected both or none"):
        DetectionSettings(width=300)
    with pytest.raises(ValueError, match=r"squeezed is true, expected detections\.width"):
        DetectionSettings(squeezed=True)
    with pytest.raises(ValueError, match=r"far_by is 'sonar', expected lidar, size, nothing"):
        DetectionSettings(far_by="sonar")
    with pytest.raises(ValueError, match="found no labels 'mine'"):
        watch(labels="mine")
