"""``World``: a room as a MuJoCo model with a robot in it. One class serves data set and live node.

Contacts, motion and scans come from here; pictures from ``camera.Camera``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim_bridge.world import gl  # noqa: F401  (chooses the back end before mujoco is imported)

import mujoco as mj  # isort: skip

from cfnav_core.task.camera import MAST, TURTLEBOT4_TOP_M
from sim_bridge.room.parts import Part
from sim_bridge.room.room import Room
from sim_bridge.world.groups import (
    ROBOT,
    TOUCH_AND_LASER,
    TOUCH_ONLY,
    VISIBLE_MESH,
    VISIBLE_ONLY,
    VISIBLE_PRIMITIVE,
)
from sim_bridge.world.meshes import MESHES
from sim_bridge.world.model_parts import add_model

HULL_RADIUS = 0.175
"""Robot radius, metres: Nav2's ``robot_radius`` for the TurtleBot 4 (its shell has 0.164)."""
HULL_BOTTOM, HULL_TOP = 0.01, TURTLEBOT4_TOP_M
MAST_RADIUS, MAST_TOP = 0.03, 1.33
LARGEST_PICTURE = 1920
"""Pixels, either way; MuJoCo draws no larger one than the buffer that is set aside."""
LIDAR_X, LIDAR_Z = -0.04, 0.193
LIDAR_RANGE_M = 12.0
SWEEP_STEP_M = 0.0125
"""Spacing of the contact queries along a swept displacement."""
TILT_SPEED = 1.0
"""rad/s of the camera's tilt mechanism."""

_GEOM = {
    "box": mj.mjtGeom.mjGEOM_BOX,
    "cylinder": mj.mjtGeom.mjGEOM_CYLINDER,
    "ellipsoid": mj.mjtGeom.mjGEOM_ELLIPSOID,
}


@dataclass(frozen=True)
class Pose:
    """Where the robot is: x, y (m), yaw (rad, counter-clockwise), tilt (rad, up positive)."""

    x: float
    y: float
    yaw: float
    tilt: float = 0.0


@dataclass(frozen=True)
class Touch:
    """Something the robot touches.

    Attributes:
        part: "hull" or "mast".
        other: name of the object touched.
        bearing: rad in the robot's frame, counter-clockwise from forward.
        speed: m/s of the robot at the end of the step, so after the contact has slowed it.
    """

    part: str
    other: str
    bearing: float
    speed: float


class World:
    """A room with the robot: physics, contacts, free space and scans.

    Args:
        room: the furnished room.
        mast: whether the robot has one.

    The robot's base is three velocity-driven joints (x, y, yaw); contacts with any solid part
    block it. Not thread-safe.
    """

    timestep = 0.01

    def __init__(self, room: Room, mast: bool = True) -> None:
        self.room = room
        self.model, self.geom_owner = _build(room, mast)
        self.data = mj.MjData(self.model)
        self._query = mj.MjData(self.model)
        mj.mj_kinematics(self.model, self._query)  # rays need the parts where they are
        self._hull = self.model.geom("hull").id
        self._mast = self.model.geom("mast").id if mast else -1
        self._tilt = 0.0
        self._laser_groups = np.zeros(mj.mjNGROUP, np.uint8)
        self._laser_groups[[VISIBLE_PRIMITIVE, TOUCH_AND_LASER]] = 1
        self.reset(room.width / 2, room.depth / 2, 0.0)

    @property
    def pose(self) -> Pose:
        """Where the robot truly is."""
        x, y, yaw = self.data.qpos[:3]
        return Pose(float(x), float(y), float(yaw), self._tilt)

    @property
    def velocity(self) -> tuple[float, float]:
        """True forward speed (m/s) and turn rate (rad/s)."""
        vx, vy, w = self.data.qvel[:3]
        yaw = self.data.qpos[2]
        return float(vx * math.cos(yaw) + vy * math.sin(yaw)), float(w)

    def reset(self, x: float, y: float, yaw: float, tilt: float = 0.0) -> None:
        """Put the robot at rest at a pose (m, rad)."""
        mj.mj_resetData(self.model, self.data)
        self.data.qpos[:3] = (x, y, yaw)
        self._tilt = tilt
        mj.mj_forward(self.model, self.data)

    @property
    def speed(self) -> float:
        """True speed over the floor in any direction, m/s."""
        return float(np.hypot(*self.data.qvel[:2]))

    def drive(self, v: float, w: float, tilt: float, sideways: float = 0.0) -> None:
        """One physics step of ``timestep`` seconds towards these targets.

        Args:
            v: forward speed, m/s.
            w: turn rate, rad/s.
            tilt: camera tilt, rad, up positive.
            sideways: speed to the left, m/s; wheels give none, whoever pushes the robot does.
        """
        yaw = self.data.qpos[2] + 0.5 * w * self.timestep
        c, s = math.cos(yaw), math.sin(yaw)
        self.data.ctrl[:3] = (v * c - sideways * s, v * s + sideways * c, w)
        mj.mj_step(self.model, self.data)
        limit = TILT_SPEED * self.timestep
        self._tilt += min(max(tilt - self._tilt, -limit), limit)

    def contacts(self) -> list[Touch]:
        """What hull and mast touch now."""
        if self.data.ncon == 0:
            return []
        found = []
        x, y, yaw = self.data.qpos[:3]
        speed = self.speed
        for c in self.data.contact[: self.data.ncon]:
            robot, other = (
                (c.geom1, c.geom2) if c.geom1 in (self._hull, self._mast) else (c.geom2, c.geom1)
            )
            bearing = math.remainder(math.atan2(c.pos[1] - y, c.pos[0] - x) - yaw, math.tau)
            name = self.room.objects[self.geom_owner[other]].name
            found.append(Touch("hull" if robot == self._hull else "mast", name, bearing, speed))
        return found

    def free(self, x: float, y: float) -> bool:
        """Whether the robot can stand at (x, y) without touching anything."""
        q = self._query
        q.qpos[:3] = (x, y, 0.0)
        mj.mj_kinematics(self.model, q)
        mj.mj_collision(self.model, q)
        return q.ncon == 0

    def sweep_free(self, start: tuple[float, float], end: tuple[float, float]) -> bool:
        """Whether hull and mast touch nothing on the straight way from start to end (m)."""
        steps = max(1, math.ceil(math.dist(start, end) / SWEEP_STEP_M))
        # both ends first: most blocked moves end inside something
        for k in (steps, *range(steps)):
            f = k / steps
            if not self.free(
                start[0] + f * (end[0] - start[0]), start[1] + f * (end[1] - start[1])
            ):
                return False
        return True

    def scan(self, bearings: np.ndarray, pose: Pose | None = None) -> np.ndarray:
        """Beams of the LiDAR.

        Args:
            bearings: float [N], radians counter-clockwise from robot-forward.
            pose: where the robot stands; its present pose when None.

        Returns:
            float32 [N] ranges, metres, inf where nothing is hit within 12 m.
        """
        p = pose or self.pose
        origin = np.array([
            p.x + LIDAR_X * math.cos(p.yaw), p.y + LIDAR_X * math.sin(p.yaw), LIDAR_Z
        ])  # fmt: skip
        angle = bearings + p.yaw
        rays = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1).ravel()
        hit = np.zeros(len(angle), np.int32)
        distance = np.zeros(len(angle))
        mj.mj_multiRay(
            self.model, self._query, origin, rays, self._laser_groups, 1,
            self.model.body("base").id, hit, distance, None, len(angle), LIDAR_RANGE_M,
        )  # fmt: skip
        return np.where(hit >= 0, distance, np.inf).astype(np.float32)

    def occupancy(self, resolution: float = 0.02) -> np.ndarray:
        """Plan of everything solid that hull or mast can meet.

        Args:
            resolution: metres per cell.

        Returns:
            int8 [H, W], 100 occupied and 0 free, row 0 at y = 0, column 0 at x = 0.
        """
        h, w = (math.ceil(side / resolution) for side in (self.room.depth, self.room.width))
        y, x = (np.mgrid[0:h, 0:w] + 0.5) * resolution
        grid, top = np.zeros((h, w), np.int8), MAST_TOP if self._mast >= 0 else HULL_TOP
        for part in self.room.parts:
            low, high = part.centre[2] - part.half[2], part.centre[2] + part.half[2]
            if not part.solid or low > top or high < HULL_BOTTOM:
                continue
            c, s = math.cos(part.yaw), math.sin(part.yaw)
            dx, dy = x - part.centre[0], y - part.centre[1]
            u, v = np.abs(c * dx + s * dy) / part.half[0], np.abs(c * dy - s * dx) / part.half[1]
            inside = np.maximum(u, v) <= 1 if part.shape == "box" else u * u + v * v <= 1
            grid[inside] = 100
        return grid


def _build(room: Room, mast: bool) -> tuple[mj.MjModel, np.ndarray]:
    """Compile the room; also gives the owner (object index, -1 robot) of every geom."""
    spec = mj.MjSpec()
    _settings(spec, room)
    for name, picture in room.textures.items():
        texture = spec.add_texture(
            name=name, type=mj.mjtTexture.mjTEXTURE_2D, width=picture.shape[1],
            height=picture.shape[0], nchannel=3,
        )  # fmt: skip
        texture.data = np.ascontiguousarray(picture).tobytes()
    owners: list[int] = []
    materials: dict[tuple, str] = {}
    meshes: dict[tuple, str] = {}
    for part in room.parts:
        geom = {
            "pos": part.centre,
            "quat": (math.cos(part.yaw / 2), 0, 0, math.sin(part.yaw / 2)),
        }
        radius_height = (part.half[0], part.half[2], 0.0)
        primitive = {
            "type": _GEOM[part.shape],
            "size": radius_height if part.shape == "cylinder" else part.half,
        }
        touch = {"contype": 1, "conaffinity": 2} if part.solid else {"contype": 0, "conaffinity": 0}
        if not part.visible:
            spec.worldbody.add_geom(**geom, **primitive, **touch, group=_unseen(part))
            owners.append(part.owner)
            continue
        look = {"material": _material(spec, materials, part)}
        if part.texture is None:
            group = VISIBLE_PRIMITIVE if part.solid else VISIBLE_ONLY
            spec.worldbody.add_geom(**geom, **primitive, **touch, **look, group=group)
            owners.append(part.owner)
            continue
        spec.worldbody.add_geom(
            **geom, **look, type=mj.mjtGeom.mjGEOM_MESH, meshname=_mesh(spec, meshes, part),
            contype=0, conaffinity=0, group=VISIBLE_MESH,
        )  # fmt: skip
        owners.append(part.owner)
        if part.solid:
            spec.worldbody.add_geom(**geom, **primitive, **touch, group=_unseen(part))
            owners.append(part.owner)
    # what is transparent is drawn last, and shows what is behind it
    for placed in sorted(room.placed, key=lambda placed: placed.model.transparent):
        add_model(spec, placed.model, placed.frame)
        owners += placed.owners
    _robot(spec, mast)
    owners += [-1] * (1 + mast)
    return spec.compile(), np.array(owners)


def _unseen(part: Part) -> int:
    """The group of what no camera draws."""
    return TOUCH_AND_LASER if crosses_plane(part) else TOUCH_ONLY


def crosses_plane(part: Part, z: float = LIDAR_Z) -> bool:
    """Whether a horizontal plane (m) cuts a solid part."""
    return part.solid and abs(part.centre[2] - z) <= part.half[2]


def _settings(spec: mj.MjSpec, room: Room) -> None:
    v = spec.visual
    v.quality.shadowsize = 0
    v.quality.offsamples = 0
    v.quality.numslices, v.quality.numstacks, v.quality.numquads = 16, 8, 1
    v.global_.offwidth = v.global_.offheight = LARGEST_PICTURE
    v.map.znear, v.map.zfar = 0.02, 20.0
    spec.stat.extent = 1.0
    spec.stat.center = (room.width / 2, room.depth / 2, 1.0)
    v.headlight.ambient = (room.ambient,) * 3
    v.headlight.diffuse = (0.2,) * 3
    v.headlight.specular = (0.0,) * 3
    spec.option.timestep = World.timestep
    spec.option.integrator = mj.mjtIntegrator.mjINT_IMPLICITFAST
    for position, colour in room.lights:
        spec.worldbody.add_light(
            type=mj.mjtLightType.mjLIGHT_POINT, pos=position, dir=(0, 0, -1), castshadow=False,
            diffuse=colour, specular=(0.08,) * 3, attenuation=(1, 0, 0.03),
        )  # fmt: skip


def _material(spec: mj.MjSpec, known: dict[tuple, str], part: Part) -> str:
    key = (part.texture, part.colour, part.emission)
    if key not in known:
        known[key] = f"material{len(known)}"
        material = spec.add_material(
            name=known[key], rgba=(*part.colour, 1.0), emission=part.emission, shininess=0.4,
            specular=0.4 if part.texture == "steel" else 0.06,
        )  # fmt: skip
        if part.texture is not None:
            textures = list(material.textures)
            textures[mj.mjtTextureRole.mjTEXROLE_RGB] = part.texture
            material.textures = textures
    return known[key]


def _mesh(spec: mj.MjSpec, known: dict[tuple, str], part: Part) -> str:
    key = (part.shape, part.half, part.repeat)
    if key not in known:
        known[key] = f"mesh{len(known)}"
        vertices, coordinates, faces = MESHES[part.shape](part.half, part.repeat)
        mesh = spec.add_mesh(name=known[key], inertia=mj.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        mesh.uservert = vertices.ravel().tolist()
        mesh.usertexcoord = coordinates.ravel().tolist()
        mesh.userface = faces.ravel().tolist()
    return known[key]


def _robot(spec: mj.MjSpec, mast: bool) -> None:
    """Hull and mast on x, y and yaw joints with velocity actuators."""
    base = spec.worldbody.add_body(name="base")
    joints = (
        ("x", (1, 0, 0), False, 400.0),
        ("y", (0, 1, 0), False, 400.0),
        ("yaw", (0, 0, 1), True, 40.0),
    )
    for name, axis, hinge, gain in joints:
        kind = mj.mjtJoint.mjJNT_HINGE if hinge else mj.mjtJoint.mjJNT_SLIDE
        base.add_joint(name=name, type=kind, axis=axis)
        actuator = spec.add_actuator(name=name, trntype=mj.mjtTrn.mjTRN_JOINT, target=name)
        actuator.set_to_velocity(kv=gain)
    shape = {"type": mj.mjtGeom.mjGEOM_CYLINDER, "group": ROBOT, "contype": 2, "conaffinity": 1,
             "friction": (0.1, 0.005, 0.0001)}  # fmt: skip
    half = (HULL_TOP - HULL_BOTTOM) / 2
    base.add_geom(
        name="hull", size=(HULL_RADIUS, half, 0), pos=(0, 0, HULL_BOTTOM + half), mass=3.9, **shape
    )
    if mast:
        half = (MAST_TOP - HULL_TOP) / 2
        base.add_geom(
            name="mast", size=(MAST_RADIUS, half, 0), pos=(0, 0, HULL_TOP + half), mass=0.6, **shape
        )
    base.add_camera(name="rgb", fovy=90, pos=(MAST.x, 0, MAST.z))
