"""The simulator with its camera, in the room of the moment: what services and start-up ask for.

Knows no ROS: requests and responses are taken as they come. Belongs to one thread, as the camera's
GL context does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from cfnav_core.task.visibility import VISIBLE_DISTANCE_M
from sim_bridge.robot.noise import Noise, NoiseLevels
from sim_bridge.robot.simulator import Simulator
from sim_bridge.room.room import generate_room, parse_room
from sim_bridge.ros.detector import Detector
from sim_bridge.world.camera import Camera
from sim_bridge.world.grid import start_episode, state_grid
from sim_bridge.world.visual_shift import shifted
from sim_bridge.world.world import Pose, World

if TYPE_CHECKING:
    from cfnav_core.perception.boxes import Detection
    from sim_bridge.ros.parameters import MockParameters


class SimulatorStage:
    """A room, the robot in it and the robot's camera.

    Args:
        parameters: of the mock.

    Raises:
        ValueError: with one sentence, when the room makes no sense.
    """

    def __init__(self, parameters: MockParameters) -> None:
        self._parameters = parameters
        world, self.camera, self._stereo = self._build(parameters.room)
        self.noise = Noise(NoiseLevels().scaled(parameters.noise), parameters.seed)
        # a base without a bumper has nothing to answer
        reflexes = parameters.reflexes and "hazards" in parameters.described.topics
        self.simulator = Simulator(world, self.noise, reflexes, parameters.set_up.horizons)
        self._seen: tuple[tuple, bool] = ((), False)
        self._detector = Detector(parameters) if parameters.detector else None

    @property
    def world(self) -> World:
        """The room that the robot is in."""
        return self.simulator.world

    def put_robot(self) -> None:
        """Put the robot where the parameters say.

        Raises:
            ValueError: with one sentence, when that is impossible.
        """
        p = self._parameters
        if p.goal:
            start = start_episode(self.world, self.camera, p.goal, p.seed)
            self.simulator.start_episode(p.goal, start)
        elif p.start:
            pose = _pose(self.world, p.start)
            self.simulator.place(pose.x, pose.y, pose.yaw)
        else:
            self._put_anywhere(p.seed)
        if p.docked:
            self.simulator.dock()

    def start_episode(self, request: Any, response: Any) -> bool:
        """Answer a StartEpisode.

        Returns:
            Whether the robot is in another room now.
        """
        world, camera, depth = self.world, self.camera, self._stereo
        new_room = request.room != world.room.name
        try:
            if new_room:
                world, camera, depth = self._build(request.room)
            self._start(world, camera, request, response)
        except ValueError as error:
            if camera is not self.camera:
                _close(camera, depth)
            response.message = str(error)
            return False
        if camera is not self.camera:
            self.close()
            self.camera, self._stereo = camera, depth
        self.noise.reseed(request.seed)
        if self._detector:
            self._detector.reseed(request.seed)
        return new_room

    def end_episode(self, response: Any) -> Any:
        """Answer an EndEpisode; returns the response."""
        goal = self.simulator.goal
        try:
            account = self.simulator.end_episode()
        except RuntimeError as error:
            response.message = str(error)
            return response
        response.ok = True
        response.goal_visible = self.camera.goal_visible(goal)
        response.collisions = account.collisions
        response.path_length = account.path_length
        response.shortest_path = account.shortest_path
        return response

    def goal_visible(self) -> bool:
        """Whether the episode's goal is in view; drawing to find out costs as much as a picture."""
        if self.simulator.goal_distance() > VISIBLE_DISTANCE_M:
            return False
        pose = self.world.pose
        here = tuple(round(value, 4) for value in (pose.x, pose.y, pose.yaw, pose.tilt))
        key = (self.simulator.goal, id(self.camera), here)
        if self._seen[0] != key:
            self._seen = key, self.camera.goal_visible(self.simulator.goal)
        return self._seen[1]

    def close(self) -> None:
        """Free the cameras."""
        _close(self.camera, self._stereo)

    def _build(self, room: str) -> tuple[World, Camera, Camera | None]:
        """A room, the camera in it and the stereo camera, where there is one."""
        set_up = self._parameters.set_up
        world = World(generate_room(*parse_room(room)), set_up.on_mast)
        depth = Camera(world, self._parameters.stereo_set_up) if self._parameters.depth else None
        return world, Camera(world, set_up), depth

    def depth(self) -> np.ndarray:
        """What the stereo camera measures now: uint16 [H, W], mm."""
        assert self._stereo is not None, "the parameter depth is false"
        pose, set_up = self.world.pose, self._stereo.set_up
        fixed = pose if set_up.tilts else replace(pose, tilt=set_up.horizons[0])
        rgb, depth = self._stereo.depth(fixed)
        return self.noise.depth(depth, rgb)

    def detections(self) -> list[tuple[int, Detection]]:
        """What the detector on board says of what the camera sees now, with its numbers."""
        assert self._detector is not None, "the parameter detector is empty"
        return self._detector.says(self.camera, self.world.pose)

    def picture(self, dt: float) -> np.ndarray:
        """What the camera sees now, dt s after its last picture: uint8 [H, W, 3]."""
        set_up = self._parameters.set_up
        focal = set_up.focal_share[0] * set_up.size[0]
        moved = focal * self.simulator.motion.w, focal * self.simulator.tilt_rate
        seen = shifted(self.camera.rgb(), self._parameters.visual_shift)
        return self.noise.picture(seen, dt, moved)

    def _start(self, world: World, camera: Camera, request: Any, response: Any) -> None:
        """Put the robot at the start, once nothing can fail any more."""
        at = _pose(world, request.start) if len(request.start) else None
        start = None
        if request.goal or at is None:
            start = start_episode(world, camera, request.goal, request.seed, at)
            response.shortest_path = start.shortest_path
            response.shortest_actions = start.shortest_actions
            at = Pose(start.x, start.y, start.yaw)
        assert at is not None
        if world is not self.world:
            self.simulator.enter(world)
        if start is None:
            self.simulator.place(at.x, at.y, at.yaw)
        else:
            self.simulator.start_episode(request.goal, start)
        response.ok = True
        response.x, response.y, response.yaw = at.x, at.y, at.yaw

    def _put_anywhere(self, seed: int) -> None:
        """Put the robot on a reachable place of the grid, drawn from the seed."""
        grid = state_grid(self.world)
        state = np.random.default_rng(seed).integers(len(grid.next_state))
        pose = grid.pose(int(state))
        self.simulator.place(pose.x, pose.y, pose.yaw)


def _close(*cameras: Camera | None) -> None:
    for camera in cameras:
        if camera is not None:
            camera.close()


def _pose(world: World, start: Sequence[float]) -> Pose:
    """A free start pose from x m, y m, yaw rad."""
    numbers = [float(value) for value in start]
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise ValueError(f"start is {numbers}; expected [x, y, yaw] in m, m, rad.")
    x, y, yaw = numbers
    inside = 0 < x < world.room.width and 0 < y < world.room.depth
    if not (inside and world.free(x, y)):
        raise ValueError(f"start ({x}, {y}) is not free in {world.room.name}; choose another.")
    return Pose(x, y, yaw)
