"""A piece of furniture in a MuJoCo specification: meshes to see, boxes to touch."""

from __future__ import annotations

import math

import numpy as np

from sim_bridge.room.parts import Frame
from sim_bridge.sweet_home.model import Mesh, Model
from sim_bridge.world.groups import TOUCH_ONLY, VISIBLE_MESH

import mujoco as mj  # isort: skip

GLOSS = 0.5
"""Of the highlights that modellers set for other lights than MuJoCo's."""


def add_model(spec: mj.MjSpec, model: Model, frame: Frame, solid: bool = True) -> int:
    """Put a model into a room; the same model twice shares meshes, materials and textures.

    Args:
        spec: of the room.
        model: what to put there.
        frame: where its own frame's origin is.
        solid: whether its boxes stop robot and laser; its meshes never do.

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
    boxes = model.boxes if solid else ()
    for box in boxes:
        at = frame.at(*box.centre)
        spec.worldbody.add_geom(
            type=mj.mjtGeom.mjGEOM_BOX, pos=(at.x, at.y, at.z), quat=pose["quat"], size=box.half,
            contype=1, conaffinity=2, group=TOUCH_ONLY,
        )  # fmt: skip
    return len(model.meshes) + len(boxes)


def _add_mesh(spec: mj.MjSpec, name: str, mesh: Mesh) -> None:
    """The mesh and its material, both of this name, and the material's texture."""
    added = spec.add_mesh(name=name, inertia=mj.mjtMeshInertia.mjMESH_INERTIA_SHELL)
    added.uservert = mesh.vertices.ravel().tolist()
    added.userface = mesh.faces.ravel().tolist()
    if mesh.normals is not None:
        added.usernormal = mesh.normals.ravel().tolist()
    material = spec.add_material(
        name=name, rgba=mesh.colour, specular=GLOSS * mesh.specular, shininess=mesh.shininess
    )
    if mesh.texture is None or mesh.uv is None:
        return
    added.usertexcoord = mesh.uv.ravel().tolist()
    height, width, channels = mesh.texture.shape
    texture = spec.add_texture(
        name=name, type=mj.mjtTexture.mjTEXTURE_2D, width=width, height=height, nchannel=channels
    )
    texture.data = np.ascontiguousarray(mesh.texture).tobytes()
    roles = mj.mjtTextureRole
    textures = list(material.textures)
    textures[roles.mjTEXROLE_RGBA if channels == 4 else roles.mjTEXROLE_RGB] = name
    material.textures = textures
