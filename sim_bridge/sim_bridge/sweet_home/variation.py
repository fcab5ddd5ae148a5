"""The furniture in other paint and other proportions, for eyes that should know things by shape.

Of many things there are few models: of fridges that are not kept for test rooms, two. A network
that has seen only those knows them by their paint, and does not know the next one. Each room draws
how each model looks in it, so that paint tells little: it is dyed part by part, darker or brighter,
and made wider or narrower, deeper or less deep. Heights stay, as what is touched of a model lies in
bands of height (``bands``). Parts of the building, and what is glass, stay as they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import cv2
import numpy as np

from sim_bridge.sweet_home.bands import Box
from sim_bridge.sweet_home.model import Mesh, Model
from sim_bridge.sweet_home.table import Piece

STRETCH, MOST_STRETCH = 0.1, 0.25
"""Standard deviation of the logarithm of a width or depth over the usual one, and its largest."""
AS_IT_IS = 0.2
"""Share of models that keep their paint."""
LEAST_CONTRAST, MOST_CONTRAST = 0.5, 1.3
"""Of a texture about its own mean."""
BUILDING = frozenset({"door", "window", "curtain", "radiator", "wall_socket", "ceiling_lamp"})
"""Roles that keep size and paint: they fit holes, or each other."""
GROWN = frozenset({"Apple", "Bread", "HousePlant"})
"""Things that nobody dyes."""


@dataclass(frozen=True)
class Variation:
    """How a model looks in one room.

    Attributes:
        stretch: of its width and of its depth.
        seed: of this look, no other's.
        dyed: whether its paint changes.
    """

    stretch: tuple[float, float]
    seed: int
    dyed: bool

    def applied(self, model: Model) -> Model:
        """The model so; its id says by which seed, as one of another look has other meshes."""
        rng = np.random.default_rng(self.seed)
        share = float(rng.uniform(0.3, 1.0))
        x, y = self.stretch
        meshes = tuple(
            _dyed(mesh, rng)
            if self.dyed and not mesh.transparent and rng.random() < share
            else mesh
            for mesh in model.meshes
        )  # fmt: skip
        width, depth, height = model.size
        return Model(
            f"{model.id}~{self.seed}", (width * x, depth * y, height),
            tuple(_stretched(mesh, x, y) for mesh in meshes),
            tuple(
                Box((box.centre[0] * x, box.centre[1] * y, box.centre[2]),
                    (box.half[0] * x, box.half[1] * y, box.half[2]))
                for box in model.boxes
            ),
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class VariedPiece(Piece):
    """A piece with a look of its own; its entry has the size that it has so.

    Attributes:
        original: as the table has it.
        variation: of its model.
    """

    original: Piece
    variation: Variation

    def load(self) -> Model:
        """Its meshes and boxes.

        Raises:
            SweetHomeError: the archive is damaged.
        """
        return self.variation.applied(self.original.load())


def varied(
    pieces: Mapping[str, tuple[Piece, ...]], rng: np.random.Generator
) -> Mapping[str, tuple[Piece, ...]]:
    """Draw a look for every piece; what belongs together by its style shares one.

    Args:
        pieces: by role.
        rng: draws.
    """
    of_style: dict[str, Variation] = {}
    made: dict[str, tuple[Piece, ...]] = {}
    for role, its in pieces.items():
        looks = [_drawn(piece, rng) for piece in its]
        looks = [
            of_style.setdefault(piece.style, replace(look, stretch=(1.0, 1.0)))
            if piece.style else look
            for piece, look in zip(its, looks, strict=True)
        ]  # fmt: skip
        made[role] = its if role in BUILDING else tuple(map(_with, its, looks))
    return MappingProxyType(made)


def _drawn(piece: Piece, rng: np.random.Generator) -> Variation:
    x, y = np.exp(np.clip(STRETCH * rng.standard_normal(2), -MOST_STRETCH, MOST_STRETCH))
    seed = int(rng.integers(2**32))
    dyed = rng.random() >= AS_IT_IS and piece.role not in GROWN
    return Variation((float(x), float(y)), seed, dyed)


def _with(piece: Piece, look: Variation) -> VariedPiece:
    width, depth, height = piece.entry.size
    size = (width * look.stretch[0], depth * look.stretch[1], height)
    same = vars(replace(piece, entry=replace(piece.entry, size=size)))
    return VariedPiece(**same, original=piece, variation=look)


def _stretched(mesh: Mesh, x: float, y: float) -> Mesh:
    """Wider and deeper; normals lean against the stretch."""
    normals = mesh.normals
    if normals is not None:
        leaning = normals / np.array([x, y, 1.0])
        normals = (leaning / np.linalg.norm(leaning, axis=1, keepdims=True)).astype(np.float32)
    vertices = (mesh.vertices * np.array([x, y, 1.0])).astype(np.float32)
    return replace(mesh, vertices=vertices, normals=normals)


def _dyed(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """Moved towards another colour, its pattern paler or stronger."""
    dye = 255 * _colour(rng)
    weight, contrast = rng.uniform(0.2, 1.0), rng.uniform(LEAST_CONTRAST, MOST_CONTRAST)
    if mesh.texture is not None:
        mean = mesh.texture.reshape(-1, 3).mean(0)
        new = mean + weight * (dye - mean) + contrast * (mesh.texture - mean)
        return replace(mesh, texture=np.rint(np.clip(new, 0, 255)).astype(np.uint8))
    *old, alpha = mesh.colour
    red, green, blue = ((1 - weight) * np.array(old) + weight * dye / 255).tolist()
    return replace(mesh, colour=(red, green, blue, alpha))


def _colour(rng: np.random.Generator) -> np.ndarray:
    """Red, green, blue of a paint, 0 to 1: mostly pale or grey, as furniture is."""
    hsv = np.array([360 * rng.random(), 0.9 * rng.random() ** 2, rng.uniform(0.08, 1.0)])
    return cv2.cvtColor(hsv.astype(np.float32)[None, None], cv2.COLOR_HSV2RGB)[0, 0].astype(float)
