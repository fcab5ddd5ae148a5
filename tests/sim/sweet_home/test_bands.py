"""Boxes by bands of height: what they cover, and what a robot finds free by them."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import cKDTree
from sim_bridge.sweet_home import bands
from sim_bridge.sweet_home.bands import BANDS, CELL_M, PLANE, boxes, rectangles, samples
from sim_bridge.sweet_home.cache import load
from sim_bridge.sweet_home.catalogue import catalogue
from sim_bridge.world import world
from sim_bridge.world.meshes import box


def solid(x, y, z, p, q, r, open_below=False):
    """float64 [T, 3, 3]: a box around (x, y, z) with half extents; without its underside."""
    vertices, _, faces = box((p, q, r), None)
    triangles = vertices[faces] + (x, y, z)
    return triangles[triangles[..., 2].max(1) > z - r + 1e-9] if open_below else triangles


def table(z_top=0.72):
    legs = [solid(x, y, 0.35, 0.02, 0.02, 0.35) for x in (-0.5, 0.5) for y in (-0.3, 0.3)]
    return np.concatenate([*legs, solid(0, 0, z_top, 0.55, 0.35, 0.02)])


def ends(found):
    """Bottom and top of each box, metres."""
    return [(b.centre[2] - b.half[2], b.centre[2] + b.half[2]) for b in found]


def test_the_bands_are_those_of_the_robot():
    assert BANDS[0][0] == world.HULL_BOTTOM
    assert BANDS[2][1] == BANDS[3][0] == world.HULL_TOP
    assert BANDS[3][1] == world.MAST_TOP
    assert np.isclose(np.mean(BANDS[PLANE]), world.LIDAR_Z)
    assert all(below[1] == above[0] for below, above in pairwise(BANDS))


def test_a_table_is_legs_and_a_thin_top():
    found = boxes(table())
    wide = [b for b in found if b.half[0] > 0.1 or b.half[1] > 0.1]
    assert wide
    for low, high in ends(wide):
        assert (low, high) == pytest.approx((0.70, 0.74), abs=0.005)
    for (low, high), band in zip(BANDS[:3], range(3), strict=True):
        legs = [b for b in found if low < b.centre[2] < high]
        assert len(legs) == 4, legs
        for leg in legs:
            assert np.abs(np.abs(leg.centre[:2]) - (0.5, 0.3)).max() < 0.003
            assert max(leg.half[:2]) == pytest.approx(0.02, abs=0.003)
        if band == PLANE:
            np.testing.assert_allclose(ends(legs), [(low, high)] * 4)


def test_bands_are_heights_above_the_floor_not_above_the_model():
    plate = solid(0, 0, 0.1, 0.5, 0.5, 0.01)
    (on_floor,) = boxes(plate)
    assert on_floor.centre[2] == pytest.approx(0.1, abs=0.003)
    lifted = boxes(plate, 0.093)  # the laser's plane cuts it
    assert len(lifted) == 1
    np.testing.assert_allclose(ends(lifted), [(0.09, 0.11)])
    assert len(boxes(plate, 0.6)) == 1
    assert boxes(plate, 1.25) == boxes(plate, 5) == []


def test_what_lies_flat_on_the_floor_stops_nobody():
    assert boxes(solid(0, 0, 0.004, 0.6, 0.4, 0.004)) == []


def test_the_inside_of_something_hollow_is_filled():
    sofa = solid(0, 0, 0.25, 0.9, 0.4, 0.2, open_below=True)
    found = boxes(sofa)
    for low, high in BANDS:
        inside = [
            b for b in found
            if low <= b.centre[2] <= high and all(np.abs(b.centre[:2]) <= b.half[:2])
        ]  # fmt: skip
        assert len(inside) == 1
        assert inside[0].half[:2] == pytest.approx((0.9, 0.4), abs=0.003)


def test_what_is_open_stays_open():
    ring = np.concatenate([solid(0, 0, 0.2, 0.5, 0.02, 0.2), solid(-0.5, 0.3, 0.2, 0.02, 0.3, 0.2)])
    assert not any((np.abs(np.array(b.centre[:2]) - (0.2, 0.3)) < b.half[:2]).all()
                   for b in boxes(ring))  # fmt: skip


def test_something_small_is_one_box_a_band():
    cross = np.concatenate(
        [solid(0, 0, 0.25, 0.14, 0.01, 0.25), solid(0, 0, 0.25, 0.01, 0.14, 0.25)]
    )
    assert len(boxes(cross)) == 4
    assert len(boxes(cross, 0.75)) == 1


def test_samples_are_even_and_always_the_same():
    two = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[5, 0, 0], [5.5, 0, 0], [5, 1, 0]]], float)
    points = samples(two)
    np.testing.assert_array_equal(points, samples(two))
    assert len(points) == int(0.75 / CELL_M**2 * bands.SAMPLES_A_CELL)
    assert (points[:, 0] < 2).mean() == pytest.approx(2 / 3, abs=1e-3)
    first = points[points[:, 0] < 2]
    np.testing.assert_allclose(first.mean(0), (1 / 3, 1 / 3, 0), atol=0.01)
    assert (first[:, :2].sum(1) <= 1).all()


def test_rectangles_cover_every_cell_once():
    rng = np.random.default_rng(4)
    for _ in range(20):
        kinds = rng.choice([-1, 0, 0, 1], size=rng.integers(1, 12, 2))
        covered = np.zeros_like(kinds)
        for rows, columns in rectangles(kinds):
            assert len(set(kinds[rows, columns].ravel())) == 1
            covered[rows, columns] += 1
        np.testing.assert_array_equal(covered, kinds >= 0)
    assert len(list(rectangles(np.array([[0, -1], [0, -1], [0, 0]])))) == 2


FREE = {  # share of the footprint where the hull fits, by samples of the surface
    "Blend Swap CC-0#oakTable": 0.43,
    "Scopia#white_kitchen_table": 0.77,
    "Blend Swap CC-BY#table": 0.80,
    "Scopia#table_wood_and_iron": 0.23,
    "Kator Legaz#office-chair": 0.01,
    "Scopia#leather_sofa": 0.0,
    "Blend Swap CC-0#plant": 0.47,
}


@pytest.mark.long
@pytest.mark.parametrize(("name", "share"), FREE.items())
def test_the_hull_fits_where_the_surface_lets_it(name, share):
    """Needs the Debian package; the hull never fits by the boxes where it does not in truth."""
    found = load(catalogue()[name])
    points = surface(found.triangles)
    low, high = world.HULL_BOTTOM, world.HULL_TOP
    points = points[(points[:, 2] > low) & (points[:, 2] < high), :2]
    axes = (np.arange(-side / 2, side / 2, 0.01) for side in found.size[:2])
    places = np.stack(np.meshgrid(*axes), -1).reshape(-1, 2)
    truly = cKDTree(points).query(places)[0] > world.HULL_RADIUS
    by_boxes = np.ones(len(places), bool)
    for b in boxes(found.triangles):
        if b.centre[2] - b.half[2] < high and b.centre[2] + b.half[2] > low:
            away = np.maximum(np.abs(places - b.centre[:2]) - b.half[:2], 0)
            by_boxes &= np.hypot(*away.T) > world.HULL_RADIUS
    assert truly.mean() == pytest.approx(share, abs=0.01)
    assert 0 <= truly.mean() - by_boxes.mean() < 0.04
    assert (by_boxes & ~truly).mean() < 0.002


def surface(triangles):
    """float64 [300000, 3]: other samples than those the boxes are made of."""
    rng = np.random.default_rng(99)
    a, b, c = np.moveaxis(triangles, 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    at = rng.choice(len(area), 300_000, p=area / area.sum())
    weights = rng.dirichlet((1, 1, 1), len(at))
    return (weights[..., None] * triangles[at]).sum(1)
