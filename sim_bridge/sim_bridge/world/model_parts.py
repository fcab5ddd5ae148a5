"""A piece of furniture in a MuJoCo specification: meshes to see, boxes to touch."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from sim_bridge.room.parts import Frame
from sim_bridge.sweet_home.bands import Box
from sim_bridge.sweet_home.model import Mesh, Model
from sim_bridge.world.groups import TOUCH_ONLY, VISIBLE_MESH

import mujoco as mj  # isort: skip

GLOSS = 0.5
"""Of the highlights that modellers set for other lights than MuJoCo's."""
FEWEST_VERTICES = 4
"""Of a mesh in MuJoCo; a triangle repeats one."""
BLENDED = 0.99
"""Alpha from which MuJoCo's renderer looks at that of a texture; with 1 it does not."""


def add_model(spec: mj.MjSpec, model: Model, frame: Frame, boxes: Collection[Box] = ()) -> int:
    """Put a model into a room; the same model twice shares meshes, materials and textures.

    Args:
        spec: of the room.
        model: what to put there.
        frame: where its own frame's origin is.
        boxes: what stops robot and laser, in the model's frame: ``model.boxes`` where it stands at
            its own elevation, those of ``sweet_home.bands.boxes`` elsewhere. Meshes stop nothing.

    Returns:
        How many geoms were added to the world body.
    """
    pose = {
        "pos": (frame.x, frame.y, frame.z),
        "quat": (math.cos(frame.yaw / 2), 0, 0, math.sin(frame.yaw / 2)),
    }
    for i, mesh in enumerate(model.meshes):
        name = f"{model.id}/{i}"
        if spec.mesh(name) is None:
            _add_mesh(spec, name, mesh)
        spec.worldbody.add_geom(
            **pose, type=mj.mjtGeom.mjGEOM_MESH, meshname=name, material=name, contype=0,
            conaffinity=0, group=VISIBLE_MESH,
        )  # fmt: skip
    for box in boxes:
        at = frame.at(*box.centre)
        spec.worldbody.add_geom(
            type=mj.mjtGeom.mjGEOM_BOX, pos=(at.x, at.y, at.z), quat=pose["quat"], size=box.half,
            contype=1, conaffinity=2, group=TOUCH_ONLY,
        )  # fmt: skip
    return len(model.meshes) + len(boxes)


def _add_mesh(spec: mj.MjSpec, name: str, mesh: Mesh) -> None:
    """The mesh and its material, both of this name, and the material's texture."""
    count = len(mesh.vertices)
    rows = np.resize(np.arange(count), max(count, FEWEST_VERTICES))
    added = spec.add_mesh(name=name, inertia=mj.mjtMeshInertia.mjMESH_INERTIA_SHELL)
    added.uservert = mesh.vertices[rows].ravel().tolist()
    added.userface = mesh.faces.ravel().tolist()
    if mesh.normals is not None:
        added.usernormal = mesh.normals[rows].ravel().tolist()
    *colour, alpha = mesh.colour
    material = spec.add_material(
        name=name, rgba=(*colour, min(alpha, BLENDED) if mesh.transparent else alpha),
        specular=GLOSS * mesh.specular, shininess=mesh.shininess,
    )  # fmt: skip
    if mesh.texture is None or mesh.uv is None:
        return
    added.usertexcoord = mesh.uv[rows].ravel().tolist()
    height, width, channels = mesh.texture.shape
    texture = spec.add_texture(
        name=name, type=mj.mjtTexture.mjTEXTURE_2D, width=width, height=height, nchannel=channels
    )
    texture.data = np.ascontiguousarray(mesh.texture).tobytes()
    # also of four channels: MuJoCo's renderer does not look at the role RGBA
    textures = list(material.textures)
    textures[mj.mjtTextureRole.mjTEXROLE_RGB] = name
    material.textures = textures
