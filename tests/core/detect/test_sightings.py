"""Directions and distances of boxes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cfnav_core.detect.sightings import (
    Sighting,
    SightingEyes,
    by_ranges,
    by_size,
    known_sizes,
    sighted,
    table,
)
from cfnav_core.perception.boxes import Box, Detection
from cfnav_core.perception.perception import PerceptionError
from cfnav_core.task.camera import CAMERAS, MAST
from cfnav_core.task.detections import SIGHTINGS
from cfnav_core.task.pinhole import Pinhole

WIDE = CAMERAS["stock_wide"]


def seen(box: Box, camera: Pinhole, tilt: float = 0.0) -> Sighting:
    return sighted(Detection("Mug", 0.8, box), camera, tilt)


def test_the_whole_picture_is_as_wide_and_high_as_the_field_of_view() -> None:
    one = seen((0, 0, *map(float, WIDE.size)), Pinhole.of(WIDE))
    assert (one.azimuth, one.elevation) == pytest.approx((0, 0), abs=1e-9)
    assert np.degrees([one.width, one.height]) == pytest.approx(WIDE.fov_deg)


def test_right_and_up_are_positive() -> None:
    width = WIDE.size[0]
    one = seen((width - 1.0, 0.0, width + 1.0, 2.0), Pinhole.of(WIDE))
    assert one.azimuth == pytest.approx(math.radians(WIDE.fov_deg[0] / 2), abs=1e-6)
    assert 0 < one.elevation < math.radians(WIDE.fov_deg[1] / 2)


@pytest.mark.parametrize("tilt", [0.0, -0.5, 0.3])
@pytest.mark.parametrize("point", [(2.0, 0.5, -0.4), (1.0, -0.9, 0.2), (3.0, 0.0, -1.0)])
def test_a_point_is_seen_where_it_is(tilt: float, point: tuple[float, float, float]) -> None:
    """It is projected as every renderer does it, and its direction found again."""
    camera = Pinhole.of(MAST)
    ahead, left, up = point
    depth = ahead * math.cos(tilt) + up * math.sin(tilt)
    rise = up * math.cos(tilt) - ahead * math.sin(tilt)
    u = camera.cx + 0.5 - camera.fx * left / depth
    v = camera.cy + 0.5 - camera.fy * rise / depth
    one = seen((u - 1e-6, v - 1e-6, u + 1e-6, v + 1e-6), camera, tilt)
    assert one.azimuth == pytest.approx(-math.atan2(left, ahead), abs=1e-6)
    assert one.elevation == pytest.approx(math.atan2(up, math.hypot(ahead, left)), abs=1e-6)


def test_a_picture_of_another_size_shows_the_same() -> None:
    small = seen((10.0, 20.0, 30.0, 50.0), Pinhole.of(WIDE))
    large = seen((20.0, 40.0, 60.0, 100.0), Pinhole.of(WIDE, (896, 504)))
    for field in SIGHTINGS[1:]:
        assert getattr(large, field) == pytest.approx(getattr(small, field))


def test_a_row_has_the_surest_sighting_of_its_object() -> None:
    many = [
        Sighting("Mug", 0.4, 0.1, 0, 0.1, 0.1), Sighting("Mug", 0.9, 0.2, -0.1, 0.1, 0.2, 1.5),
        Sighting("Mug", 0.6, 0.3, 0, 0.1, 0.1), Sighting("zebra", 1.0, 0, 0, 1, 1),
    ]  # fmt: skip
    made = table(many, ("Apple", "Mug"))
    assert made.dtype == np.float16
    np.testing.assert_array_equal(made[0], np.zeros(6))
    np.testing.assert_allclose(made[1], [0.9, 0.2, -0.1, 0.1, 0.2, 1.5], rtol=1e-3)


def test_the_nearer_of_width_and_height_counts() -> None:
    far = by_size({"Mug": (0.1, 0.2)})
    whole = Sighting("Mug", 1, 0, 0, 2 * math.atan(0.05 / 2), 2 * math.atan(0.1 / 2))
    assert far(whole) == pytest.approx(2.0)
    cut = Sighting("Mug", 1, 0, 0, whole.width / 3, whole.height)
    assert far(cut) == pytest.approx(2.0)
    assert far(Sighting("zebra", 1, 0, 0, 0.1, 0.1)) == 0


def test_sizes_that_are_shipped_are_those_of_such_things() -> None:
    sizes = known_sizes()
    assert 0.3 < sizes["Chair"][0] < 0.9
    assert 0.6 < sizes["Chair"][1] < 1.2
    assert max(sizes["Mug"]) < 0.3
    assert min(min(size) for size in sizes.values()) > 0


def test_the_lidar_tells_how_far_what_is_in_the_direction_of_a_box_is() -> None:
    bearings = np.radians(np.arange(-180, 180))
    ranges = np.full(360, 4.0)
    ranges[(bearings > np.radians(18)) & (bearings < np.radians(22))] = 1.2
    ranges[bearings > np.radians(100)] = np.inf
    far = by_ranges(bearings, ranges)
    assert far(Sighting("Mug", 1, math.radians(-20), 0, 0.1, 0.1)) == pytest.approx(1.2)
    assert far(Sighting("Mug", 1, math.radians(20), 0, 0.1, 0.1)) == pytest.approx(4.0)
    assert far(Sighting("Mug", 1, math.radians(-150), 0, 0.1, 0.1)) == 0


def test_numbers_that_are_none_are_no_table() -> None:
    for wrong in (math.nan, math.inf, 1e6):
        with pytest.raises(ValueError, match="not finite"):
            table([Sighting("Mug", 0.9, 0.1, 0.0, 0.1, 0.1, wrong)], ("Mug",))


def test_a_policy_that_reads_sightings_is_given_no_picture() -> None:
    eyes = SightingEyes(("Mug",), (4,))
    found = eyes.observe([Sighting("Mug", 0.5, 0, 0, 0.1, 0.1)])
    assert (found.features.shape, found.detections.shape) == ((1, 4), (1, 1, 6))
    with pytest.raises(PerceptionError, match=r"found a picture .*expected sightings"):
        eyes.observe(np.zeros((3, 3, 3), np.uint8))
