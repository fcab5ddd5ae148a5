"""Pages of pictures of furniture models: ``cfnav rooms models --out DIR --only sofa``.

Each tile shows a model as MuJoCo draws it, from its front and a little to the side, on a floor of
10 cm squares, with its id and its width, depth and height in centimetres. Files are named
``page_001.png`` and so on.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

from cfnav_core.command import DONE, PARTLY
from sim_bridge.data.pages import labelled, on_pages, write_pages
from sim_bridge.room.parts import Frame
from sim_bridge.sweet_home.cache import load
from sim_bridge.sweet_home.catalogue import SweetHomeError, catalogue
from sim_bridge.sweet_home.model import Model
from sim_bridge.world import gl  # noqa: F401  (chooses the back end before mujoco is imported)
from sim_bridge.world.model_parts import add_model

import mujoco as mj  # isort: skip

COLUMNS, ROWS, TILE = 6, 5, 220
FOV_DEG = 35.0
SIDE_DEG, DOWN_DEG = 30.0, 22.0
"""Where the viewer stands: so far from the front to the thing's own right, and up."""


@dataclass(frozen=True)
class ModelOptions:
    """Draw furniture models of sweethome3d-furniture on pages, to look at.

    Exit code 1 when some cannot be read; each has a line that says why.
    """

    out: Path
    """Folder for the pages."""
    only: str = "."
    """Regular expression that is searched in ids, names and categories, for example 'sofa|chair'.
    """

    def run_command(self) -> int:
        """Draw.

        Raises:
            ValueError: no model is meant.
        """
        try:
            wanted = re.compile(self.only, re.IGNORECASE)
        except re.error as error:
            raise ValueError(
                f"found --only {self.only!r}, expected a regular expression ({error})"
            ) from error
        entries = [
            entry
            for entry in catalogue().values()
            if any(map(wanted.search, (entry.id, entry.name, entry.category)))
        ]
        if not entries:
            raise ValueError(f"found no model whose id, name or category has {self.only!r}")
        left_out: list[str] = []

        def models() -> Iterator[Model]:
            for entry in tqdm(entries, unit="model", mininterval=2.0):
                try:
                    yield load(entry)
                except SweetHomeError as error:
                    left_out.append(str(error))

        pages = write_pages(contact_sheet(models()), self.out)
        print(*left_out, sep="\n", end="\n" if left_out else "")
        print(f"{len(entries) - len(left_out)} models on {pages} pages in {self.out}")
        return PARTLY if left_out else DONE


def contact_sheet(models: Iterable[Model], columns: int = COLUMNS, rows: int = ROWS,
                  side: int = TILE) -> Iterator[np.ndarray]:  # fmt: skip
    """Draw models on pages.

    Args:
        models: in the order of the tiles.
        columns, rows: of a page.
        side: pixels of a tile, either way.

    Returns:
        Pages, uint8 [rows * side, columns * side, 3]; the last with as many rows as it needs.
    """
    tiles = (labelled(draw(model, side), *_lines(model)) for model in models)
    return on_pages(tiles, columns, rows)


def draw(model: Model, side: int) -> np.ndarray:
    """A picture of a model from its front and right: uint8 [side, side, 3]."""
    radius = math.hypot(*model.size) / 2
    spec = mj.MjSpec()
    spec.visual.global_.offwidth = spec.visual.global_.offheight = side
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = (0.5,) * 3, (0.4,) * 3
    spec.stat.extent, spec.stat.center = radius, (0, 0, model.size[2] / 2)
    spec.visual.map.znear, spec.visual.map.zfar = 0.05, 50.0
    spec.worldbody.add_light(
        type=mj.mjtLightType.mjLIGHT_DIRECTIONAL, dir=(-0.4, -0.5, -0.8), diffuse=(0.4,) * 3,
        castshadow=False,
    )  # fmt: skip
    _add_surroundings(spec, 3 * radius)
    add_model(spec, model, Frame(0, 0))
    compiled = spec.compile()
    compiled.vis.global_.fovy = FOV_DEG
    data = mj.MjData(compiled)
    mj.mj_forward(compiled, data)
    camera = mj.MjvCamera()
    camera.lookat[:] = (0, 0, model.size[2] / 2)
    camera.distance = 1.05 * radius / math.sin(math.radians(FOV_DEG / 2))
    # the direction of looking; a viewer in front looks along -y
    camera.azimuth, camera.elevation = -90 - SIDE_DEG, -DOWN_DEG
    with mj.Renderer(compiled, side, side) as renderer:
        renderer.update_scene(data, camera)
        renderer.scene.flags[mj.mjtRndFlag.mjRND_SHADOW] = 0
        return np.asarray(renderer.render())


def _add_surroundings(spec: mj.MjSpec, half: float) -> None:
    """A floor of 10 cm squares just below the model, and a light sky."""
    spec.add_texture(
        type=mj.mjtTexture.mjTEXTURE_SKYBOX, builtin=mj.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=(0.92, 0.93, 0.95), width=8, height=8,
    )  # fmt: skip
    texture = spec.add_texture(
        name="floor", type=mj.mjtTexture.mjTEXTURE_2D, builtin=mj.mjtBuiltin.mjBUILTIN_CHECKER,
        width=64, height=64, rgb1=(0.80, 0.82, 0.85), rgb2=(0.72, 0.74, 0.78),
    )  # fmt: skip
    material = spec.add_material(name="floor", texrepeat=(5, 5), texuniform=True)
    textures = list(material.textures)
    textures[mj.mjtTextureRole.mjTEXROLE_RGB] = texture.name
    material.textures = textures
    spec.worldbody.add_geom(
        type=mj.mjtGeom.mjGEOM_PLANE, size=(half, half, 1), pos=(0, 0, -0.002), material="floor"
    )


def _lines(model: Model) -> tuple[str, str]:
    """Id and size."""
    return model.id, " x ".join(f"{100 * side:.0f}" for side in model.size) + " cm"
