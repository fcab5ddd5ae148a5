"""Pictures with labels, for training perception: the format, not who renders them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from cfnav_core.files.whole import whole, writing
from cfnav_core.perception.sight import Sight
from cfnav_core.task.camera import MAST, CameraSetUp
from cfnav_core.task.vocabulary import CATEGORIES

HEAD = "set.json"
"""Of a finished set: what it is of."""
FIELDS = ("pictures", "heat", "near", "depth", "floor")


@dataclass(frozen=True)
class PictureSet:
    """N labelled views of one room.

    Attributes:
        pictures: uint8 [N, *P, 3]; P, Q and R are ``picture``, ``heat`` and ``coarse`` of the
            camera's ``Sight``, 150x150, 19x19 and 10x10 from the mast.
        heat: uint8 [N, *Q, C], pixels of each category in each cell of the full picture (cells of
            16 pixels of the picture padded alike on both sides), at most 255.
        near: uint8 [N, *Q, C], such pixels of things that are visible (``visibility.visible``).
        depth: float16 [N, *R], mean metres along the optical axis.
        floor: uint8 [N, *R], share of floor, 0..255.
        objects: names of the C categories.
        camera: that took them.
        source: what made the room and its pictures, and its version.
        states: of the room, from which the views were drawn.
    """

    pictures: np.ndarray
    heat: np.ndarray
    near: np.ndarray
    depth: np.ndarray
    floor: np.ndarray
    objects: tuple[str, ...] = CATEGORIES
    camera: CameraSetUp = MAST
    source: str = ""
    states: int = 0

    @cached_property
    def visible(self) -> np.ndarray:
        """Bool [N, C]: which categories are visible."""
        return np.asarray(self.near).max((1, 2)) > 0

    def save(self, folder: Path) -> None:
        """Write the set; ``folder`` appears only when complete.

        Raises:
            WriteError: the disk is full or refuses; what was there before stays whole.
        """
        with writing(folder), whole(folder) as partial:
            partial.mkdir(parents=True)
            head = {
                "categories": self.objects, "camera": self.camera.to_json(),
                "source": self.source, "states": self.states,
            }  # fmt: skip
            for key in FIELDS:
                np.save(partial / f"{key}.npy", getattr(self, key))
            (partial / HEAD).write_text(json.dumps(head))

    @classmethod
    def load(cls, folder: Path) -> PictureSet:
        """Open a set, memory-mapped.

        Raises:
            ValueError: missing, damaged, or of another version.
        """
        try:
            head = json.loads((folder / HEAD).read_text())
            arrays = {k: np.load(folder / f"{k}.npy", mmap_mode="r") for k in FIELDS}
            out = cls(
                **arrays, objects=tuple(head["categories"]),
                camera=CameraSetUp.from_json(head["camera"]),
                source=head["source"], states=head["states"],
            )  # fmt: skip
        except (OSError, EOFError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise ValueError(
                f"found no readable picture set in {folder} ({error}); make it again with "
                "cfnav rooms make --views N"
            ) from error
        expected = (len(out.pictures), *Sight.of(out.camera).picture, 3)
        if out.near.shape[3:] != (len(CATEGORIES),) or out.pictures.shape != expected:
            raise ValueError(f"found a picture set of another version in {folder}; make it again")
        if out.objects != CATEGORIES:
            raise ValueError(
                f"found a picture set of other categories in {folder}, expected "
                f"{', '.join(CATEGORIES)}; make it again with cfnav rooms make --views N"
            )
        return out
