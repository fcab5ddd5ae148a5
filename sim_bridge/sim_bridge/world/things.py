"""The things in a picture with their true boxes, as a perfect detector would have them."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import find_objects

from cfnav_core.detect.errors import Thing
from cfnav_core.perception.boxes import Box
from cfnav_core.task.pinhole import Pinhole
from sim_bridge.world.camera import Camera
from sim_bridge.world.world import Pose

NEAREST_M = 0.05
"""What is less far ahead of the camera is taken to be so far: behind it nothing has a place."""

LEAST_PX = 16
"""Pixels of a thing that no detector would tell are left out."""


class Things:
    """Tells what a camera sees.

    Args:
        camera: in its world.
    """

    def __init__(self, camera: Camera) -> None:
        self._camera, world = camera, camera.world
        self._names = [thing.name for thing in world.room.objects]
        self._pinhole = Pinhole.of(camera.set_up)
        data, model = camera.data, world.model
        signs = np.stack(np.meshgrid(*[(-1, 1)] * 3), -1).reshape(8, 3)
        middle, half = model.geom_aabb[:, None, :3], model.geom_aabb[:, None, 3:]
        turned = np.einsum("gij,gkj->gki", data.geom_xmat.reshape(-1, 3, 3), middle + half * signs)
        corners = turned + data.geom_xpos[:, None]
        self._corners = [corners[camera.shows == k].reshape(-1, 3) for k in range(len(self._names))]

    def seen(self, pose: Pose, owner: np.ndarray) -> list[Thing]:
        """What is in a picture, of what can be a goal.

        Args:
            pose: of the robot.
            owner: of ``Camera.picture`` there.
        """
        away, (at, axes) = self._camera.distances(pose), self._camera.looks(pose)
        found = []
        for k, seen in enumerate(find_objects(owner + 1)):
            if seen is None or not len(self._corners[k]):
                continue
            rows, columns = seen
            if np.count_nonzero(owner[seen] == k) < LEAST_PX:
                continue
            box: Box = (columns.start, rows.start, columns.stop, rows.stop)
            whole = self._projected((self._corners[k] - at) @ axes.T)
            share = (box[2] - box[0]) * (box[3] - box[1]) / whole
            found.append(Thing(self._names[k], box, min(share, 1.0), float(away[k])))
        return found

    def _projected(self, corners: np.ndarray) -> float:
        """Area of the box around points right, up and ahead of the camera, float [N, 3], pixels."""
        ahead = np.maximum(corners[:, 2], NEAREST_M)
        wide = np.ptp(corners[:, 0] / ahead) * self._pinhole.fx
        high = np.ptp(corners[:, 1] / ahead) * self._pinhole.fy
        return float(max(wide * high, 1.0))
