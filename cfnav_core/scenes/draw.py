"""How the published training code draws episodes, as the probability of each task."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cfnav_core.scenes.layouts import Layout

Law = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Probability of each task by its scene, room type and instances: ``chances`` of one layout."""


def chances(
    layout: Layout, scene: np.ndarray, room_type: np.ndarray, instances: np.ndarray
) -> np.ndarray:
    """Scenes alike, or room types alike and then their scenes; targets by their instances.

    The published workers go through the room types in turn; drawn at random, each type gets the
    same share of the episodes.

    Args:
        layout: the data set.
        scene: int [K], scene of each task.
        room_type: int [K], room type of that scene.
        instances: int [K], how many instances of its target the scene has, at least one.

    Returns:
        float64 [K], of sum 1.

    Source: HOZ ``episodes/basic_episode.py``, SAVN ``runners/nonadaptivea3c_train.py``.
    """
    chance = instances / np.bincount(scene, instances)[scene]
    if layout.room_types_in_turn:
        _, first = np.unique(scene, return_index=True)
        chance /= np.bincount(room_type[first])[room_type]
    out: np.ndarray = chance / chance.sum()
    return out
