"""What the built-in network looks at, by the camera: its input and the grids of its maps."""

from __future__ import annotations

from dataclasses import dataclass

from cfnav_core.task.camera import MAST, CameraSetUp

CELL = 8
"""Pixels of the input, either way, that a cell of the category map stands for."""


def cells(rows: int, columns: int) -> tuple[int, int]:
    """Rows and columns of the category map of a network that takes pictures of a size, pixels."""
    return -(-rows // CELL), -(-columns // CELL)


@dataclass(frozen=True)
class Sight:
    """Sizes as rows and columns.

    Attributes:
        picture: pixels of the input; a camera's picture is averaged 2x2 to it.
        heat: cells of the category map.
        coarse: cells of the depth and floor maps.
    """

    picture: tuple[int, int]
    heat: tuple[int, int]
    coarse: tuple[int, int]

    @classmethod
    def of(cls, camera: CameraSetUp) -> Sight:
        """How the built-in network looks through a camera."""
        width, height = camera.size
        rows, columns = height // 2, width // 2
        heat = cells(rows, columns)
        return cls((rows, columns), heat, (-(-heat[0] // 2), -(-heat[1] // 2)))


FROM_MAST = Sight.of(MAST)
