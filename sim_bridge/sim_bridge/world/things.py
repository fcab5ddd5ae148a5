"""The things in a picture with their true boxes, as a perfect detector would have them."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import find_objects
from scipy.spatial import ConvexHull, QhullError

from cfnav_core.detect.errors import Thing
from cfnav_core.perception.boxes import Box
from cfnav_core.task.pinhole import Pinhole
from sim_bridge.world.camera import Camera
from sim_bridge.world.world import Pose

import mujoco as mj  # isort: skip

NEAREST_M = 0.05
"""What is less far ahead of the camera is taken to be so far: behind it nothing has a place."""

LEAST_PX = 16
"""Pixels of a thing that no detector would tell are left out."""


ROUND = 24
"""Points around a round thing: the box around so many is no more than 1 % smaller than its own."""


def surface(model: mj.MjModel, geom: int) -> np.ndarray:
    """Points of a geom in its own frame, whose box in any picture is the geom's: float [N, 3], m.

    Source: MuJoCo's documentation of ``geom/type`` and ``geom/size``.
    """
    kind, size = mj.mjtGeom(model.geom_type[geom]), model.geom_size[geom]
    if kind == mj.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        return _hull(model.mesh_vert[first : first + model.mesh_vertnum[mesh]])
    around = np.linspace(0, 2 * np.pi, ROUND, endpoint=False)
    circle = np.stack([np.cos(around), np.sin(around)], 1)
    if kind == mj.mjtGeom.mjGEOM_CYLINDER:
        return np.concatenate([np.insert(size[0] * circle, 2, z, 1) for z in (-size[1], size[1])])
    if kind in (mj.mjtGeom.mjGEOM_SPHERE, mj.mjtGeom.mjGEOM_ELLIPSOID, mj.mjtGeom.mjGEOM_CAPSULE):
        up = np.linspace(-np.pi / 2, np.pi / 2, ROUND // 2 + 1)
        ball = np.concatenate([np.insert(np.cos(u) * circle, 2, np.sin(u), 1) for u in up])
        if kind != mj.mjtGeom.mjGEOM_CAPSULE:
            return ball * (size if kind == mj.mjtGeom.mjGEOM_ELLIPSOID else size[0])
        return np.concatenate([size[0] * ball + (0, 0, z) for z in (-size[1], size[1])])
    middle, half = model.geom_aabb[geom].reshape(2, 3)
    return middle + half * np.stack(np.meshgrid(*[(-1, 1)] * 3), -1).reshape(8, 3)


def _hull(points: np.ndarray) -> np.ndarray:
    """Those of float [N, 3] that the others lie between; all of them where they are flat."""
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:
        return points


class Things:
    """Tells what a camera sees.

    Args:
        camera: in its world.
    """

    def __init__(self, camera: Camera) -> None:
        self._camera, world = camera, camera.world
        self._names = [thing.name for thing in world.room.objects]
        self._pinhole = Pinhole.of(camera.set_up)
        data = camera.data
        self._surfaces = [
            np.concatenate([
                surface(world.model, int(geom)) @ data.geom_xmat[geom].reshape(3, 3).T
                + data.geom_xpos[geom]
                for geom in np.flatnonzero(camera.shows == k)
            ] or [np.empty((0, 3))])
            for k in range(len(self._names))
        ]  # fmt: skip

    def seen(self, pose: Pose, owner: np.ndarray) -> list[Thing]:
        """What is in a picture, of what can be a goal.

        Args:
            pose: of the robot.
            owner: of ``Camera.picture`` there.
        """
        away, (at, axes) = self._camera.distances(pose), self._camera.looks(pose)
        found = []
        for k, seen in enumerate(find_objects(owner + 1)):
            if seen is None or not len(self._surfaces[k]):
                continue
            rows, columns = seen
            if np.count_nonzero(owner[seen] == k) < LEAST_PX:
                continue
            box: Box = (columns.start, rows.start, columns.stop, rows.stop)
            whole = self._projected((self._surfaces[k] - at) @ axes.T)
            share = (box[2] - box[0]) * (box[3] - box[1]) / whole
            found.append(Thing(self._names[k], box, min(share, 1.0), float(away[k])))
        return found

    def _projected(self, points: np.ndarray) -> float:
        """Area of the box around points right, up and ahead of the camera, float [N, 3], pixels."""
        ahead = np.maximum(points[:, 2], NEAREST_M)
        wide = np.ptp(points[:, 0] / ahead) * self._pinhole.fx
        high = np.ptp(points[:, 1] / ahead) * self._pinhole.fy
        return float(max(wide * high, 1.0))
