"""Declared versions hold: what is made is what the version made when it was declared.

Data are told apart by these versions. When one of these tests fails, either the change is a mistake
or the version must rise with it and the number here be replaced.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pytest
from cfnav_ros.lidar.states import ESTIMATE_VERSION, probabilities
from sim_bridge.data.scans import SCANS_VERSION
from sim_bridge.robot.lidar_turn import standing_turn
from sim_bridge.robot.noise import Noise, NoiseLevels
from sim_bridge.robot.simulator import SIMULATOR_VERSION, Simulator
from sim_bridge.room.room import ROOMS_VERSION, Room, generate_room
from sim_bridge.world.grid import state_grid
from sim_bridge.world.world import World

from cfnav_core.scenes.scene import HORIZONS


class Fingerprint:
    """Of what was made: its words to the letter, its numbers up to a processor's last bits.

    Textures are rounded to whole grey levels, so that last bits move some texels by a level: their
    means and deviations stand apart.
    """

    def __init__(self, made: Any) -> None:
        self.words: list[str] = []
        self.numbers: list[float] = []
        self.levels: list[float] = []
        self._take(made)

    def _take(self, value: Any) -> None:
        if is_dataclass(value) and not isinstance(value, type):
            value = {field.name: getattr(value, field.name) for field in fields(value)}
        if isinstance(value, dict):
            for key in sorted(value, key=str):
                self.words.append(str(key))
                self._take(value[key])
        elif isinstance(value, np.ndarray):
            self.words.append(str(value.shape))
            self.levels += [value.astype(float).mean(), value.astype(float).std()]
        elif isinstance(value, (list, tuple)):
            for part in value:
                self._take(part)
        elif isinstance(value, (float, int, np.floating, np.integer)):
            self.numbers.append(float(value))
        else:
            self.words.append(str(value))

    @property
    def sums(self) -> tuple[float, float]:
        """Of numbers and of levels, each with a weight of its own: one that moves shows."""
        parts = [np.array(part) for part in (self.numbers, self.levels)]
        weights = (np.random.default_rng(0).uniform(1.0, 2.0, len(part)) for part in parts)
        numbers, levels = (float(w @ part) for w, part in zip(weights, parts, strict=True))
        return numbers, levels

    @property
    def hash(self) -> str:
        """Of the words and of how many numbers there are."""
        text = json.dumps([self.words, len(self.numbers)])
        return hashlib.sha256(text.encode()).hexdigest()[:12]


@pytest.fixture(scope="module")
def bathroom() -> World:
    return World(generate_room("bathroom", 3))


def furnished(room: Room) -> Fingerprint:
    """Of a room with models: which they are, and where they stand."""
    models = [(placed.model.id, placed.frame, placed.owners) for placed in room.placed]
    return Fingerprint([room.parts, room.objects, models, room.lights, room.ambient])


@pytest.mark.parametrize(
    ("kind", "seed", "words", "numbers", "levels"),
    [
        ("kitchen", 20, "328bfffcfd53", 6675.83293, 9321.569),
        ("living_room", 21, "45813c68f81c", 4075.79450, 9258.097),
        ("bedroom", 22, "9e9538917ab7", 4137.99215, 9260.726),
        ("bathroom", 3, "6d15b47de3b0", 2358.77902, 9398.124),
    ],
)
def test_rooms(kind: str, seed: int, words: str, numbers: float, levels: float) -> None:
    made = Fingerprint(generate_room(kind, seed))
    assert (ROOMS_VERSION, made.hash) == (1, words)
    found, found_levels = made.sums
    assert found == pytest.approx(numbers, abs=5e-5)  # 0.1 mm
    assert found_levels == pytest.approx(levels, abs=0.01)


def test_the_grid_of_a_room(bathroom: World) -> None:
    grid = state_grid(bathroom)
    made = hashlib.sha256(np.ascontiguousarray(grid.next_state, np.int64))
    made.update(np.ascontiguousarray(grid.collided, np.uint8))
    assert (ROOMS_VERSION, made.hexdigest()[:12]) == (1, "c7cc4b0c733e")
    assert Fingerprint([*map(list, grid.positions)]).sums[0] == pytest.approx(450.82191, abs=5e-5)


def test_scans_and_estimates(bathroom: World) -> None:
    errors = Noise(NoiseLevels(), 3)
    grid = state_grid(bathroom)
    made = [standing_turn(bathroom, errors, pose=grid.pose(s)) for s in range(0, 80, HORIZONS)]
    seen = np.isfinite(made)
    p = probabilities(np.stack(made))
    # a processor's last bits move a range by less than any figure here can show
    about = [int(np.sum(seen)), float(np.sum(made, where=seen)), float(p.sum())]
    assert (SCANS_VERSION, ESTIMATE_VERSION) == (2, 3)
    assert about == pytest.approx([39823, 43834.020, 24.27700], rel=1e-4)


def test_a_drive(bathroom: World) -> None:
    """Half a metre, a turn, and on until something is touched."""
    simulator = Simulator(bathroom, Noise(NoiseLevels(), 7), reflexes=True)
    start = state_grid(bathroom).pose(0)
    simulator.place(start.x, start.y, 0.0)
    poses = []
    for velocity, rate, seconds in ((0.2, 0.0, 1.5), (0.0, 0.8, 1.0), (0.2, 0.3, 12.0)):
        for _ in range(round(seconds / bathroom.timestep)):
            simulator.command(velocity, rate)
            simulator.step()
        pose = bathroom.pose
        poses.append([round(v, 3) for v in (pose.x, pose.y, pose.yaw, simulator.path_length)])
    assert (SIMULATOR_VERSION, simulator.collisions.count) == (2, 4)
    np.testing.assert_allclose(
        poses,
        [[0.526, 0.751, 0.006, 0.276], [0.56, 0.752, 0.67, 0.31], [0.186, 1.891, 3.584, 2.212]],
        atol=0.01,
    )
