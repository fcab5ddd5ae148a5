"""Pictures with labels, for training perception: the format, not who renders them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfnav_core.files.whole import whole, writing
from cfnav_core.perception.perception import INPUT_SIZE
from cfnav_core.task.camera import MAST, CameraSetUp
from cfnav_core.task.vocabulary import CATEGORIES

HEAT, COARSE = 19, 10
"""Cells per side of the category map and of the depth and floor maps."""

FIELDS = ("pictures", "heat", "depth", "floor", "visible")


@dataclass(frozen=True)
class PictureSet:
    """N labelled views of one room.

    Attributes:
        pictures: uint8 [N, 150, 150, 3].
        heat: uint8 [N, 19, 19, C], pixels of each category in each cell of the full picture
            (cells of 16 pixels of a 300x300 picture padded by 2), at most 255.
        depth: float16 [N, 10, 10], mean metres along the optical axis.
        floor: uint8 [N, 10, 10], share of floor, 0..255.
        visible: bool [N, C], see ``visibility.visible``.
        objects: names of the C categories.
        camera: that took them.
    """

    pictures: np.ndarray
    heat: np.ndarray
    depth: np.ndarray
    floor: np.ndarray
    visible: np.ndarray
    objects: tuple[str, ...] = CATEGORIES
    camera: CameraSetUp = MAST

    def save(self, folder: Path) -> None:
        """Write the set; ``folder`` appears only when complete.

        Raises:
            WriteError: the disk is full or refuses; what was there before stays whole.
        """
        with writing(folder), whole(folder) as partial:
            partial.mkdir(parents=True)
            head = {"categories": self.objects, "camera": self.camera.to_json()}
            for key in FIELDS:
                np.save(partial / f"{key}.npy", getattr(self, key))
            (partial / "set.json").write_text(json.dumps(head))

    @classmethod
    def load(cls, folder: Path) -> PictureSet:
        """Open a set, memory-mapped.

        Raises:
            ValueError: missing, damaged, or of another version.
        """
        try:
            head = json.loads((folder / "set.json").read_text())
            arrays = {k: np.load(folder / f"{k}.npy", mmap_mode="r") for k in FIELDS}
            camera = head.get("camera")  # sets that say none were taken from the mast
            out = cls(
                **arrays, objects=tuple(head["categories"]),
                camera=CameraSetUp.from_json(camera) if camera else MAST,
            )  # fmt: skip
        except (OSError, ValueError, KeyError) as error:
            raise ValueError(
                f"found no readable picture set in {folder} ({error}); make it again with "
                "cfnav rooms make --views N"
            ) from error
        expected = (len(out.pictures), INPUT_SIZE, INPUT_SIZE, 3)
        if out.visible.shape[1:] != (len(out.objects),) or out.pictures.shape != expected:
            raise ValueError(f"found a picture set of another version in {folder}; make it again")
        return out
