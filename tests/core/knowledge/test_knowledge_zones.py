"""Zones against numbers worked out by hand and against plain loops."""

import numpy as np
import pytest

from cfnav_core.knowledge.zones import ZONES, ZoneGraph, k_means, merge, zone_distance, zone_graph


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_distance_of_a_view_and_a_centre():
    seen = np.array([[1, 1, 0], [0, 0, 0]], bool).astype(float)
    centres = np.array([[1, 0, 0], [0.5, 0.5, 1]])
    expected = [[1 + 1 / 1.1, np.sqrt(1.5) + 1 / 1.1], [1 + 10, np.sqrt(1.5) + 10]]
    np.testing.assert_allclose(zone_distance(seen, centres), expected)


def line(views: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Eight places 0.25 m apart; from place k only object k is seen, in ``views`` headings."""
    position = np.repeat(np.arange(ZONES), views)
    places = np.stack([0.25 * np.arange(ZONES), np.zeros(ZONES)], 1).astype(np.float32)
    return np.eye(ZONES, dtype=bool)[position], position, places


def test_zones_of_eight_kinds_of_views():
    graph = zone_graph(*line(3), rng())
    shows = graph.nodes.argmax(1)
    assert sorted(shows) == list(range(ZONES))
    np.testing.assert_array_equal(graph.nodes, np.eye(ZONES)[shows])
    assert graph.views.tolist() == [3] * ZONES
    # places up to two steps apart are neighbours
    expected = abs(shows[:, None] - shows) <= 2
    np.testing.assert_array_equal(graph.edges, expected)


def test_edges_are_shares_of_neighbouring_pairs():
    draw = rng()
    seen = draw.random((90, 12)) < 0.25
    # finer than the grid, where straight and L1 distance would find the same neighbours
    places = draw.integers(-9, 9, (20, 2)).astype(np.float32) * 0.125
    position = draw.integers(20, size=90)
    graph, zone = zone_graph(seen, position, places, rng()), k_means(seen, rng())
    for a in range(ZONES):
        np.testing.assert_allclose(graph.nodes[a], seen[zone == a].mean(0))
        for b in range(ZONES):
            pairs = [
                abs(places[position[i]] - places[position[j]]).sum() <= 0.5
                for i in np.nonzero(zone == a)[0] for j in np.nonzero(zone == b)[0]
            ]  # fmt: skip
            assert graph.edges[a, b] == pytest.approx(1 if a == b else np.mean(pairs))


def test_zones_repeat_with_the_seed():
    seen = rng().random((200, 10)) < 0.3
    np.testing.assert_array_equal(k_means(seen, rng()), k_means(seen, rng()))


def test_every_view_is_with_its_nearest_centre():
    seen = rng().random((300, 10)) < 0.3
    zone = k_means(seen, rng())
    centres = np.stack([seen[zone == k].mean(0) for k in range(ZONES)])
    np.testing.assert_array_equal(zone_distance(seen.astype(float), centres).argmin(1), zone)


def test_a_room_with_fewer_kinds_of_views_than_zones():
    seen, position, places = (x[:9] if len(x) > ZONES else x for x in line(3))
    graph = zone_graph(seen, position, places, rng())
    assert sorted(graph.views) == [0] * 5 + [3] * 3
    empty = graph.views == 0
    assert (graph.nodes[empty] == 0).all()
    np.testing.assert_array_equal(graph.edges[empty], np.eye(ZONES)[empty])


def room(order: np.ndarray, share: float, edge: np.ndarray, empty: int | None = None) -> ZoneGraph:
    """Zone ``order[k]`` shows object k in a share of its views."""
    nodes, views = np.zeros((ZONES, ZONES)), np.full(ZONES, 4)
    nodes[order] = share * np.eye(ZONES)
    edges = np.zeros_like(edge)
    edges[np.ix_(order, order)] = edge
    if empty is not None:
        nodes[order[empty]], views[order[empty]] = 0, 0
    return ZoneGraph(nodes, edges, views)


def test_zones_of_rooms_are_matched_in_a_chain():
    draw = rng()
    edge = np.arange(64).reshape(ZONES, ZONES) / 64
    orders = [np.arange(ZONES), draw.permutation(ZONES), draw.permutation(ZONES)]
    rooms = [room(o, s, edge * s) for o, s in zip(orders, (1.0, 0.8, 0.6), strict=True)]
    graph = merge(rooms, ZONES)
    np.testing.assert_allclose(graph.nodes, 0.8 * np.eye(ZONES))
    off = ~np.eye(ZONES, dtype=bool)
    np.testing.assert_allclose(graph.edges[off], 0.8 * edge[off])
    assert (np.diagonal(graph.edges) == 1).all()
    assert graph.views.tolist() == [12] * ZONES


def test_a_zone_without_views_is_left_out_of_the_mean():
    edge = np.full((ZONES, ZONES), 0.5)
    rooms = [room(np.arange(ZONES), 1.0, edge), room(np.arange(ZONES), 0.5, edge, empty=3)]
    graph = merge(rooms, ZONES)
    np.testing.assert_allclose(np.diagonal(graph.nodes), np.where(np.arange(ZONES) == 3, 1, 0.75))
    assert graph.edges[3, 4] == 0.5


def test_a_type_without_rooms_knows_nothing():
    graph = merge([], 5)
    assert graph.nodes.shape == (ZONES, 5)
    assert not graph.nodes.any()
    np.testing.assert_array_equal(graph.edges, np.eye(ZONES))
