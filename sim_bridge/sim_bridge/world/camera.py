"""Pictures of a ``World``: RGB, depth and which object each pixel shows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import TracebackType

import numpy as np

from cfnav_core.task.camera import MAST, CameraSetUp
from cfnav_core.task.visibility import VISIBLE_DISTANCE_M, visible
from cfnav_core.task.vocabulary import CATEGORIES
from sim_bridge.world.groups import TOUCH_ONLY
from sim_bridge.world.world import LARGEST_PICTURE, Pose, World

import mujoco as mj  # isort: skip


@dataclass(frozen=True)
class Rendering:
    """What the camera sees.

    Attributes:
        rgb: uint8 [H, W, 3].
        depth: float32 [H, W], metres along the optical axis.
        owner: int32 [H, W], index into ``room.objects``, -1 for none.
    """

    rgb: np.ndarray
    depth: np.ndarray
    owner: np.ndarray


def pixels_of(owner: np.ndarray, objects: int) -> np.ndarray:
    """Pixels of every object, int64 [objects], in a picture of ``Rendering.owner``."""
    return np.bincount(owner.ravel() + 1, minlength=objects + 1)[1:]


class Camera:
    """Renders a world. Create, use and close it in one thread; it owns a GL context.

    Args:
        world: what to look at; its own physics state is not touched.
        set_up: where the camera sits and what it shows.

    Raises:
        ValueError: its pictures are larger than can be drawn.

    Attributes:
        set_up, world: as given.
        data: of MuJoCo, where all that it looks at is.
        shows: int [geoms], of which goal, an index into ``room.objects``, each is seen; -1 of none.
    """

    def __init__(self, world: World, set_up: CameraSetUp = MAST) -> None:
        self.set_up = set_up
        self.world = world
        self._mount = set_up.x, set_up.z
        width, height = set_up.size
        if max(set_up.size) > LARGEST_PICTURE:
            raise ValueError(
                f"found a camera of {width} x {height} pixels, expected at most {LARGEST_PICTURE} "
                "along each side; give a smaller size of the same view"
            )
        model = world.model
        self._id = model.camera("rgb").id
        self.data = mj.MjData(model)
        mj.mj_forward(model, self.data)
        self._renderer = mj.Renderer(model, height, width)
        self._shape = (height, width)
        self._rectangle = mj.MjrRect(0, 0, width, height)
        self._option = mj.MjvOption()
        self._option.geomgroup[:] = (1, 1, 1, 0, 0, 0)
        self._option.sitegroup[:] = 0
        near, far = (getattr(model.vis.map, k) * model.stat.extent for k in ("znear", "zfar"))
        self._near_far = float(near), float(far)
        objects = world.room.objects
        self._category = np.array(
            [CATEGORIES.index(o.name) if o.name in CATEGORIES else -1 for o in objects]
        )
        self._footprint = np.array([o.footprint for o in objects])
        self._groups = model.geom_group.copy()
        seen = self._option.geomgroup[self._groups] > 0
        is_goal = np.append(self._category >= 0, False)
        self.shows = np.where(seen & is_goal[world.geom_owner], world.geom_owner, -1)
        # a plane has no bounding sphere
        self._reach = np.where(model.geom_rbound > 0, model.geom_rbound, np.inf)

    def __enter__(self) -> Camera:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        self.close()

    def close(self) -> None:
        """Free the GL context."""
        self._renderer.close()

    def rgb(self, pose: Pose | None = None) -> np.ndarray:
        """The picture at a pose (the robot's own when None): uint8 [H, W, 3]."""
        self._aim(pose or self.world.pose)
        rgb = np.empty((*self._shape, 3), np.uint8)
        self._read(rgb, None)
        return np.ascontiguousarray(rgb[::-1])

    def depth(self, pose: Pose | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Picture, uint8 [H, W, 3], and depth, float32 [H, W], metres along the axis, at a pose."""
        self._aim(pose or self.world.pose)
        return self._draw()

    def picture(self, pose: Pose | None = None) -> Rendering:
        """Picture, depth and owners at a pose (the robot's own when None)."""
        self._aim(pose or self.world.pose)
        rgb, depth = self._draw()
        return Rendering(rgb, depth, self._owners())

    def owners(self, pose: Pose) -> np.ndarray:
        """Which object each pixel shows at a pose: int32 [H, W], see ``Rendering``."""
        self._aim(pose)
        return self._owners()

    def owner_pixels(self, pose: Pose | None = None) -> np.ndarray:
        """int64 [objects]: pixels of every object at a pose."""
        self._aim(pose or self.world.pose)
        return pixels_of(self._owners(), len(self._category))

    def visible_things(
        self, pose: Pose | None = None, owner_pixels: np.ndarray | None = None
    ) -> np.ndarray:
        """Bool [objects]: which things of a category are visible (at the robot's pose when None).

        Args:
            pose: of the robot.
            owner_pixels: of every object, where they are known; else what is near is looked at.

        Source: ``cfnav_core.task.visibility.visible``.
        """
        pose = pose or self.world.pose
        distance = self.distances(pose)
        if owner_pixels is None:
            owner_pixels = self._near_pixels(pose, distance <= VISIBLE_DISTANCE_M)
        return visible(owner_pixels, distance, self.set_up) & (self._category >= 0)

    def distances(self, pose: Pose) -> np.ndarray:
        """How far the nearest point of each thing's footprint is, float [objects], metres."""
        x0, y0, x1, y1 = self._footprint.T
        dx = np.maximum(np.maximum(x0 - pose.x, pose.x - x1), 0)
        dy = np.maximum(np.maximum(y0 - pose.y, pose.y - y1), 0)
        return np.hypot(dx, dy)

    def visible_categories(
        self, pose: Pose | None = None, owner_pixels: np.ndarray | None = None
    ) -> np.ndarray:
        """Bool [C]: of which categories anything is visible, see ``visible_things``."""
        out = np.zeros(len(CATEGORIES), bool)
        out[self._category[self.visible_things(pose, owner_pixels)]] = True
        return out

    def goal_visible(self, goal: str, pose: Pose | None = None) -> bool:
        """Whether a category is visible at a pose (the robot's own when None)."""
        return bool(self.visible_categories(pose)[CATEGORIES.index(goal)])

    def looks(self, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
        """Where it is at a pose, float [3], m, and what is right, up and forward, rows [3, 3]."""
        axes = self._place(pose)
        return self.data.cam_xpos[0].copy(), axes

    def _near_pixels(self, pose: Pose, near: np.ndarray) -> np.ndarray:
        """int64 [objects]: pixels of the near ones that can be goals; others may be missing.

        What lies behind all of them hides none and is not drawn.
        """
        nothing = np.zeros(len(self._category), np.int64)
        if not near[self._category >= 0].any():
            return nothing
        axes = self._place(pose)
        away = self._out_of_view(axes)
        wanted = ~away & (self.shows >= 0) & near[self.shows]
        if not wanted.any():
            return nothing
        distance = np.linalg.norm(self.data.geom_xpos - self.data.cam_xpos[0], axis=1)
        last = (distance + self._reach)[wanted].max()
        self._gather(away | (distance - self._reach > last))
        return pixels_of(self._owners(), len(nothing))

    def _aim(self, pose: Pose) -> None:
        self._gather(self._out_of_view(self._place(pose)))

    def _place(self, pose: Pose) -> np.ndarray:
        """Put the camera at a pose; right, up and forward of it, one in each row."""
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        ct, st = math.cos(pose.tilt), math.sin(pose.tilt)
        forward = np.array([ct * c, ct * s, st])
        right = np.array([s, -c, 0.0])
        up = np.cross(right, forward)
        x, z = self._mount
        # the model is shared with other cameras of the same world, and with its laser
        self.world.model.cam_fovy[self._id] = self.set_up.fov_deg[1]
        self.data.cam_xpos[0] = (pose.x + x * c, pose.y + x * s, z)
        self.data.cam_xmat[0] = np.stack([right, up, -forward], 1).ravel()
        return np.stack([right, up, forward])

    def _gather(self, away: np.ndarray) -> None:
        """Bring into the scene what is to be drawn: all but some geoms, bool [geoms]."""
        self.world.model.geom_group[away] = TOUCH_ONLY
        try:
            self._renderer.update_scene(self.data, self._id, self._option)
        finally:
            self.world.model.geom_group[:] = self._groups
        flags = self._renderer.scene.flags
        flags[mj.mjtRndFlag.mjRND_SHADOW] = flags[mj.mjtRndFlag.mjRND_REFLECTION] = 0

    def _out_of_view(self, axes: np.ndarray) -> np.ndarray:
        """Which geoms cannot be in the picture: bool [geoms], by their bounding spheres.

        MuJoCo would draw what is behind the camera as well.

        Args:
            axes: of ``_place``.
        """
        right, up, forward = axes @ (self.data.geom_xpos - self.data.cam_xpos[0]).T
        steep = math.tan(math.radians(self.set_up.fov_deg[1]) / 2)
        wide = steep * self._shape[1] / self._shape[0]
        beside = np.abs(right) - wide * forward > self._reach * math.hypot(1, wide)
        beyond = np.abs(up) - steep * forward > self._reach * math.hypot(1, steep)
        return beside | beyond | (forward < -self._reach)

    def _draw(self) -> tuple[np.ndarray, np.ndarray]:
        rgb = np.empty((*self._shape, 3), np.uint8)
        depth = np.empty(self._shape, np.float32)
        self._read(rgb, depth)
        near, far = self._near_far
        context = self._renderer._mjr_context
        if context.readDepthMap == mj.mjtDepthMap.mjDEPTH_ZEROFAR:
            metres = near * far / np.maximum(near + depth * (far - near), 1e-6)
        else:
            metres = near * far / np.maximum(far - depth * (far - near), 1e-6)
        return np.ascontiguousarray(rgb[::-1]), metres[::-1]

    def _read(self, rgb: np.ndarray, depth: np.ndarray | None) -> None:
        r = self._renderer
        r._gl_context.make_current()
        mj.mjr_render(self._rectangle, r.scene, r._mjr_context)
        mj.mjr_readPixels(rgb, depth, self._rectangle, r._mjr_context)

    def _owners(self) -> np.ndarray:
        scene = self._renderer.scene
        ids = np.empty((*self._shape, 3), np.uint8)
        segment, colour = mj.mjtRndFlag.mjRND_SEGMENT, mj.mjtRndFlag.mjRND_IDCOLOR
        scene.flags[segment] = scene.flags[colour] = 1
        self._read(ids, None)
        scene.flags[segment] = scene.flags[colour] = 0
        index = ids[..., 0].astype(np.int32) | (ids[..., 1].astype(np.int32) << 8)
        table = np.full(scene.ngeom + 2, -1, np.int32)
        for geom in scene.geoms[: scene.ngeom]:
            if geom.segid != -1 and geom.objtype == mj.mjtObj.mjOBJ_GEOM:
                table[geom.segid + 1] = self.world.geom_owner[geom.objid]
        return table[index[::-1]]
