"""The state grid of a world: where the robot can be, what actions do, where episodes start."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from cfnav_core.actions import HORIZONS_RAD, NUM_ACTIONS, STEP_M, Action
from cfnav_core.scene import HEADINGS, HORIZONS, actions_to, metres_to
from cfnav_core.visibility import VISIBLE_DISTANCE_M
from cfnav_core.vocabulary import CATEGORIES, CATEGORY_ID
from sim_bridge.camera import Camera
from sim_bridge.world import Pose, World

DIRECTIONS = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
"""Grid step of MoveAhead for headings 0..7 (yaw = heading * 45 degrees)."""

EDGE_OF_VIEW_RAD = math.radians(75)
"""Largest bearing in a 90-degree picture: its lower corners look past 45 degrees when tilted."""

MIN_START_ACTIONS = 5
"""Fewest actions between a start and seeing the goal."""


@dataclass(frozen=True)
class StateGrid:
    """Reachable states and transitions.

    Attributes:
        positions: float32 [P, 2], metres, multiples of 0.25.
        next_state: int32 [S, 6].
        collided: bool [S], MoveAhead would collide.
    """

    positions: np.ndarray
    next_state: np.ndarray
    collided: np.ndarray

    @property
    def position(self) -> np.ndarray:
        """int32 [S], row of ``positions``."""
        return np.arange(len(self.next_state), dtype=np.int32) // (HEADINGS * HORIZONS)

    @property
    def heading(self) -> np.ndarray:
        """int8 [S], 0..7."""
        return (np.arange(len(self.next_state)) // HORIZONS % HEADINGS).astype(np.int8)

    @property
    def horizon(self) -> np.ndarray:
        """int8 [S], 0 level or 1 down."""
        return (np.arange(len(self.next_state)) % HORIZONS).astype(np.int8)

    def pose(self, state: int) -> Pose:
        """The robot pose of a state."""
        x, y = self.positions[state // (HEADINGS * HORIZONS)]
        heading = state // HORIZONS % HEADINGS
        return Pose(float(x), float(y), heading * math.pi / 4, HORIZONS_RAD[state % HORIZONS])


def state_grid(world: World) -> StateGrid:
    """Find the largest set of grid positions joined by collision-free MoveAheads.

    Raises:
        ValueError: the room is too full for the robot.
    """
    room = world.room
    nx, ny = int(room.width / STEP_M), int(room.depth / STEP_M)
    cells = [
        (i, j) for i in range(1, nx + 1) for j in range(1, ny + 1)
        if i * STEP_M < room.width
        and j * STEP_M < room.depth
        and world.free(i * STEP_M, j * STEP_M)
    ]  # fmt: skip
    if not cells:
        raise ValueError(f"found no place for the robot in room {room.name}; choose another seed")
    index = {cell: k for k, cell in enumerate(cells)}
    ahead = np.full((len(cells), HEADINGS), -1, np.int32)
    for (i, j), k in index.items():
        for heading in range(HEADINGS // 2):
            di, dj = DIRECTIONS[heading]
            other = index.get((i + di, j + dj))
            if other is not None and world.sweep_free(
                (i * STEP_M, j * STEP_M), ((i + di) * STEP_M, (j + dj) * STEP_M)
            ):
                ahead[k, heading], ahead[other, heading + HEADINGS // 2] = other, k
    rows, columns = np.nonzero(ahead >= 0)
    links = csr_array((np.ones(len(rows)), (rows, ahead[rows, columns])), (len(cells),) * 2)
    _, label = connected_components(links, directed=False)
    keep = np.nonzero(label == np.bincount(label).argmax())[0]
    renumber = np.full(len(cells) + 1, -1, np.int32)
    renumber[keep] = np.arange(len(keep))
    positions = np.array([cells[k] for k in keep], np.float32) * STEP_M
    return StateGrid(positions, *_transitions(renumber[ahead[keep]]))


def _transitions(ahead: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Next states and collisions from the neighbour of each (position, heading), -1 for none."""
    n = len(ahead)
    p, heading, horizon = (
        a.ravel() for a in np.meshgrid(*map(np.arange, (n, HEADINGS, HORIZONS)), indexing="ij")
    )

    def state(p: np.ndarray, heading: np.ndarray, horizon: np.ndarray | int) -> np.ndarray:
        return (p * HEADINGS + heading) * HORIZONS + horizon

    target = ahead[p, heading]
    collided = target < 0
    next_state = np.empty((len(p), NUM_ACTIONS), np.int32)
    next_state[:, Action.MoveAhead] = state(np.where(collided, p, target), heading, horizon)
    next_state[:, Action.RotateLeft] = state(p, (heading + 1) % HEADINGS, horizon)
    next_state[:, Action.RotateRight] = state(p, (heading - 1) % HEADINGS, horizon)
    next_state[:, Action.LookUp] = state(p, heading, 0)
    next_state[:, Action.LookDown] = state(p, heading, 1)
    next_state[:, Action.Done] = np.arange(len(p))
    return next_state, collided


def goal_states(world: World, camera: Camera, grid: StateGrid, goal: str) -> np.ndarray:
    """Bool [S]: states that see the goal, by rendering those near enough and facing it.

    With a camera that does not tilt none of the tilted states does.
    """
    out = np.zeros(len(grid.next_state), bool)
    boxes = np.array([o.footprint for o in world.room.objects if o.name == goal])
    x, y = grid.positions.T[:, :, None]
    distance = np.hypot(
        np.clip(x, boxes[:, 0], boxes[:, 2]) - x, np.clip(y, boxes[:, 1], boxes[:, 3]) - y
    )
    # nothing of an object is in the picture unless some point of its footprint is near the cone
    points = _points(boxes)
    bearing = np.arctan2(points[:, 1] - y[:, None, :], points[:, 0] - x[:, None, :])
    for state in range(0, len(out), 1 if camera.tilts else HORIZONS):
        p, heading = state // (HEADINGS * HORIZONS), state // HORIZONS % HEADINGS
        off = np.abs((bearing[p] - heading * math.pi / 4 + math.pi) % math.tau - math.pi)
        if ((distance[p] <= VISIBLE_DISTANCE_M) & (off < EDGE_OF_VIEW_RAD).any(0)).any():
            out[state] = camera.goal_visible(goal, grid.pose(state))
    return out


def _points(boxes: np.ndarray) -> np.ndarray:
    """[36, 2, K] points spread over K footprints (x0, y0, x1, y1), edges and corners included."""
    part = np.linspace(0, 1, 6)[:, None]
    xs, ys = (boxes[:, i] + part * (boxes[:, i + 2] - boxes[:, i]) for i in (0, 1))
    return np.stack([np.stack([x, y]) for x in xs for y in ys])


@dataclass(frozen=True)
class Start:
    """Where an episode starts (m, rad), and its shortest way to see the goal (m, actions)."""

    x: float
    y: float
    yaw: float
    shortest_path: float
    shortest_actions: int


def start_episode(
    world: World, camera: Camera, goal: str, seed: int, at: Pose | None = None
) -> Start:
    """Draw a level start pose at least ``MIN_START_ACTIONS`` actions away from seeing the goal.

    Args:
        world: the room.
        camera: looks into it; used in the calling thread.
        goal: category name.
        seed: chooses among the possible starts.
        at: the start pose, which then is not drawn; its shortest way is that of the nearest state.

    Raises:
        ValueError: the room has no such goal, or it cannot be seen from anywhere far enough.
    """
    room = world.room
    if goal not in room.goals:
        known = "is no known category" if goal not in CATEGORY_ID else "is not in it"
        raise ValueError(f"room {room.name}: goal {goal!r} {known}; it has {', '.join(room.goals)}")
    grid = state_grid(world)
    seen = goal_states(world, camera, grid, goal)
    actions = actions_to(grid.next_state, seen)
    if at is None:
        state = _draw_start(room.name, goal, seed, actions, int(seen.sum()))
        at = grid.pose(state)
    else:
        state = _nearest_level(grid, at)
    if actions[state] < 0:
        raise ValueError(
            f"room {room.name}: no way leads from ({at.x:.2f}, {at.y:.2f}) to a sight of {goal}; "
            "choose another start"
        )
    metres = metres_to(grid.next_state, seen, grid.position, grid.heading)[grid.position[state]]
    return Start(at.x, at.y, at.yaw, float(metres), int(actions[state]) + 1)


def _draw_start(room: str, goal: str, seed: int, actions: np.ndarray, seen: int) -> int:
    """A level state at least ``MIN_START_ACTIONS`` actions away, given int [S] actions to go."""
    level = np.arange(len(actions)) % HORIZONS == 0
    starts = np.nonzero((actions >= MIN_START_ACTIONS) & level)[0]
    if not len(starts):
        raise ValueError(
            f"room {room}: {goal} is seen from {seen} states and no start is at "
            f"least {MIN_START_ACTIONS} actions away; choose another goal or room"
        )
    return int(np.random.default_rng([seed, CATEGORIES.index(goal)]).choice(starts))


def _nearest_level(grid: StateGrid, pose: Pose) -> int:
    """The level state nearest to a pose: first in place, then in heading."""
    position = int(np.hypot(*(grid.positions - (pose.x, pose.y)).T).argmin())
    heading = round(pose.yaw / (math.tau / HEADINGS)) % HEADINGS
    return (position * HEADINGS + heading) * HORIZONS
