"""The state grid of a world: where the robot can be, what actions do, where episodes start."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from cfnav_core.scenes.scene import HEADINGS, OfflineScene, actions_to, metres_to
from cfnav_core.task.actions import NUM_ACTIONS, STEP_M, Action
from cfnav_core.task.camera import MAST, CameraSetUp
from cfnav_core.task.rooms import AGAIN
from cfnav_core.task.visibility import MIN_GOAL_STATES, VISIBLE_DISTANCE_M
from cfnav_core.task.vocabulary import CATEGORIES, CATEGORY_ID
from sim_bridge.room.room import room_of
from sim_bridge.world.camera import Camera
from sim_bridge.world.world import Pose, World

DIRECTIONS = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
"""Grid step of MoveAhead for headings 0..7 (yaw = heading * 45 degrees)."""

EDGE_MARGIN_RAD = math.radians(5)
"""A bearing this far past the picture's edge is looked at all the same."""

MIN_START_ACTIONS = 5
"""Fewest actions between a start and seeing the goal."""


@dataclass(frozen=True)
class StateGrid:
    """Reachable states and transitions.

    Attributes:
        positions: float32 [P, 2], metres, multiples of 0.25.
        next_state: int32 [S, 6].
        collided: bool [S], MoveAhead would collide.
        horizons: H tilts, rad; states of a position and heading lie side by side.
    """

    positions: np.ndarray
    next_state: np.ndarray
    collided: np.ndarray
    horizons: tuple[float, ...]

    @property
    def position(self) -> np.ndarray:
        """int32 [S], row of ``positions``."""
        return np.arange(len(self.next_state), dtype=np.int32) // (HEADINGS * len(self.horizons))

    @property
    def heading(self) -> np.ndarray:
        """int8 [S], 0..7."""
        return (np.arange(len(self.next_state)) // len(self.horizons) % HEADINGS).astype(np.int8)

    @property
    def horizon(self) -> np.ndarray:
        """int8 [S], 0 level, row of ``horizons``."""
        return (np.arange(len(self.next_state)) % len(self.horizons)).astype(np.int8)

    def pose(self, state: int) -> Pose:
        """The robot pose of a state."""
        each = len(self.horizons)
        x, y = self.positions[state // (HEADINGS * each)]
        heading = state // each % HEADINGS
        return Pose(float(x), float(y), heading * math.pi / 4, self.horizons[state % each])


def state_grid(world: World, horizons: tuple[float, ...] = MAST.horizons) -> StateGrid:
    """Find the largest set of grid positions joined by collision-free MoveAheads.

    Args:
        world: the room.
        horizons: tilts that the camera looks from, rad.

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
    return StateGrid(positions, *_transitions(renumber[ahead[keep]], len(horizons)), horizons)


def remade(scene: OfflineScene) -> tuple[World, StateGrid]:
    """The world of a scene and its states, whose poses the scene's states have.

    Args:
        scene: of a room of ours, as ``cfnav rooms make`` names it.

    Raises:
        ValueError: the room is made otherwise today.
    """
    set_up = scene.camera or MAST
    world = World(room_of(scene.name, scene.source), set_up.on_mast)
    grid = state_grid(world, set_up.horizons)
    if not np.array_equal(grid.next_state, scene.next_state):
        raise ValueError(
            f"found a scene of {scene.name} made by another version; {AGAIN} with "
            f"--rooms {scene.name}"
        )
    return world, grid


def _transitions(ahead: np.ndarray, horizons: int) -> tuple[np.ndarray, np.ndarray]:
    """Next states and collisions from the neighbour of each (position, heading), -1 for none."""
    n = len(ahead)
    p, heading, horizon = (
        a.ravel() for a in np.meshgrid(*map(np.arange, (n, HEADINGS, horizons)), indexing="ij")
    )

    def state(p: np.ndarray, heading: np.ndarray, horizon: np.ndarray) -> np.ndarray:
        return (p * HEADINGS + heading) * horizons + horizon

    target = ahead[p, heading]
    collided = target < 0
    next_state = np.empty((len(p), NUM_ACTIONS), np.int32)
    next_state[:, Action.MoveAhead] = state(np.where(collided, p, target), heading, horizon)
    next_state[:, Action.RotateLeft] = state(p, (heading + 1) % HEADINGS, horizon)
    next_state[:, Action.RotateRight] = state(p, (heading - 1) % HEADINGS, horizon)
    next_state[:, Action.LookUp] = state(p, heading, np.maximum(horizon - 1, 0))
    next_state[:, Action.LookDown] = state(p, heading, np.minimum(horizon + 1, horizons - 1))
    next_state[:, Action.Done] = np.arange(len(p))
    return next_state, collided


def goal_states(world: World, camera: Camera, grid: StateGrid, goal: str) -> np.ndarray:
    """Bool [S]: states that see the goal, by rendering those near enough and facing it."""
    out = facing(world, camera.set_up, grid, goal)
    for state in np.flatnonzero(out):
        out[state] = camera.goal_visible(goal, grid.pose(int(state)))
    return out


def sightings(
    world: World, camera: Camera, grid: StateGrid, enough: int = MIN_GOAL_STATES
) -> dict[str, int]:
    """From how many states each goal of a room is seen, counted to ``enough``.

    Renders only states that may still matter, in an order that finds what is seen often at once.
    """
    near = {goal: facing(world, camera.set_up, grid, goal) for goal in world.room.goals}
    count = dict.fromkeys(near, 0)
    for state in np.random.default_rng(0).permutation(len(grid.next_state)):
        if any(near[goal][state] and count[goal] < enough for goal in near):
            pose = grid.pose(int(state))
            seen = camera.visible_categories(pose)
            for goal in near:
                count[goal] = min(enough, count[goal] + int(seen[CATEGORY_ID[goal]]))
    return count


def facing(world: World, camera: CameraSetUp, grid: StateGrid, goal: str) -> np.ndarray:
    """Bool [S]: states near enough to see a goal, from which some of it lies in the view's width.

    Nothing of an object is in the picture unless some point of its footprint is near the cone.
    """
    boxes = np.array([o.footprint for o in world.room.objects if o.name == goal])
    x, y = grid.positions.T[:, :, None]
    distance = np.hypot(
        np.clip(x, boxes[:, 0], boxes[:, 2]) - x, np.clip(y, boxes[:, 1], boxes[:, 3]) - y
    )
    points = _points(boxes)
    bearing = np.arctan2(points[:, 1] - y[:, None, :], points[:, 0] - x[:, None, :])
    ahead = np.arange(HEADINGS)[:, None, None] * (math.pi / 4)
    off = np.abs((bearing[:, None] - ahead + math.pi) % math.tau - math.pi)
    shown = (off < edge_of_view(camera)).any(2) & (distance <= VISIBLE_DISTANCE_M)[:, None]
    return np.repeat(shown.any(2).ravel(), len(grid.horizons))


def edge_of_view(camera: CameraSetUp) -> float:
    """Largest bearing in a camera's pictures, rad; tilted, they show more at the corners."""
    wide, high = (math.tan(math.radians(fov) / 2) for fov in camera.fov_deg)
    ahead = [math.cos(at) - abs(math.sin(at)) * high for at in camera.horizons]
    return max(math.atan2(wide, way) for way in ahead) + EDGE_MARGIN_RAD


def _points(boxes: np.ndarray) -> np.ndarray:
    """[36, 2, K] points spread over K footprints (x0, y0, x1, y1), edges and corners included."""
    part = np.linspace(0, 1, 6)[:, None]
    xs, ys = (boxes[:, i] + part * (boxes[:, i + 2] - boxes[:, i]) for i in (0, 1))
    return np.stack([np.stack([x, y]) for x in xs for y in ys])


@dataclass(frozen=True)
class StartPose:
    """Where an episode starts (m, rad), and its shortest way to see the goal (m, actions)."""

    x: float
    y: float
    yaw: float
    shortest_path: float
    shortest_actions: int


def start_episode(
    world: World, camera: Camera, goal: str, seed: int, at: Pose | None = None
) -> StartPose:
    """Draw a level start pose at least ``MIN_START_ACTIONS`` actions away from seeing the goal.

    Args:
        world: the room.
        camera: looks into it; used in the calling thread.
        goal: category name.
        seed: chooses among the possible starts.
        at: the start pose, which then is not drawn; its shortest way is that of the nearest state.

    Raises:
        ValueError: the room has no such goal, the camera sees it from fewer than
            ``MIN_GOAL_STATES`` states, or no start is far enough away.
    """
    room = world.room
    if goal not in room.goals:
        known = "is no known category" if goal not in CATEGORY_ID else "is not in it"
        raise ValueError(f"room {room.name}: goal {goal!r} {known}; it has {', '.join(room.goals)}")
    grid = state_grid(world, camera.set_up.horizons)
    seen = goal_states(world, camera, grid, goal)
    if seen.sum() < MIN_GOAL_STATES:
        raise ValueError(
            f"room {room.name}: {goal} is seen within {VISIBLE_DISTANCE_M} m from {seen.sum()} "
            f"states by this camera ({camera.set_up}), expected {MIN_GOAL_STATES} or more; choose "
            "another goal, room or camera"
        )
    actions = actions_to(grid.next_state, seen)
    if at is None:
        state = _draw_start(room.name, goal, seed, grid, actions, int(seen.sum()))
        at = grid.pose(state)
    else:
        state = _nearest_level(grid, at)
    if actions[state] < 0:
        raise ValueError(
            f"room {room.name}: no way leads from ({at.x:.2f}, {at.y:.2f}) to a sight of {goal}; "
            "choose another start"
        )
    metres = metres_to(grid.next_state, seen, grid.position, grid.heading)[grid.position[state]]
    return StartPose(at.x, at.y, at.yaw, float(metres), int(actions[state]) + 1)


def _draw_start(
    room: str, goal: str, seed: int, grid: StateGrid, actions: np.ndarray, seen: int
) -> int:
    """A level state at least ``MIN_START_ACTIONS`` actions away, given int [S] actions to go."""
    starts = np.nonzero((actions >= MIN_START_ACTIONS) & (grid.horizon == 0))[0]
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
    return (position * HEADINGS + heading) * len(grid.horizons)
