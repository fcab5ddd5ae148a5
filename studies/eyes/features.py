"""What features still tell of depth and free floor: ``python -m studies.eyes.features``.

A policy and its collision predictor see 256 numbers of each picture. Here a ridge regression reads
depth and floor from them again, learnt in every other room and judged in the rest. So networks can
be compared before any policy has learnt with them: what is not in the features no predictor finds.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from cfnav_core.command import run_options
from cfnav_core.perception.perception import OnnxPerception
from cfnav_core.perception.picture_set import HEAD, PictureSet
from cfnav_core.task.rooms import room_folder, rooms_in

RIDGE = 100.0
"""Weight of the squares of the coefficients, of features with a spread of 1."""


@dataclass(frozen=True)
class FeaturesOptions:
    """Read depth and free floor from the features of perception networks."""

    data: Path
    """Folder of picture sets (cfnav rooms make --views N) of rooms that no network here learnt
    from."""
    perception: tuple[Path, ...]
    """ONNX files of networks that look at pictures of this size."""
    cells: int = 0
    """Average depth and floor over so many rows and columns, so that networks of other sizes can be
    compared: smaller cells are harder to tell. 0: over the cells of the pictures' own maps."""


@dataclass(frozen=True)
class Told:
    """What the features of a network tell of pictures of rooms that the regression did not learn.

    Attributes:
        depth_error: mean of how far the depth of a cell is off, as a share of it.
        depth, floor: share of the variance that is told, mean over cells.
    """

    depth_error: float
    depth: float
    floor: float


def told(network: OnnxPerception, folders: list[Path], cells: int = 0) -> Told:
    """Learn in every other set and judge in the rest.

    Args:
        network: whose features.
        folders: of the picture sets, two or more.
        cells: rows and columns of what is told, see ``FeaturesOptions``.

    Raises:
        ValueError: a set is damaged or its pictures do not fit.
    """
    seen, depth, floor, room = [], [], [], []
    for number, folder in enumerate(folders):
        pictures = PictureSet.load(folder)
        count = len(pictures.pictures)
        features = network(np.asarray(pictures.pictures)).features
        seen.append(features.reshape(count, -1).astype(np.float64))
        depth.append(_averaged(np.log(np.asarray(pictures.depth, np.float64).clip(0.1, 8)), cells))
        floor.append(_averaged(np.asarray(pictures.floor, np.float64) / 255, cells))
        room += [number] * count
    learns = np.array(room) % 2 == 0
    x, d, f = map(np.concatenate, (seen, depth, floor))
    said, truth = _ridge(x, d, learns), d[~learns]
    return Told(
        depth_error=float(np.abs(np.exp(said - truth) - 1).mean()),
        depth=_explained(said, truth), floor=_explained(_ridge(x, f, learns), f[~learns]),
    )  # fmt: skip


def _averaged(maps: np.ndarray, cells: int) -> np.ndarray:
    """[N, R, C] -> [N, K], averaged over so many rows and columns where they are named."""
    if cells:
        size = (cells, cells)
        maps = np.stack([cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in maps])
    return maps.reshape(len(maps), -1)


def _ridge(x: np.ndarray, y: np.ndarray, learns: np.ndarray) -> np.ndarray:
    """What a ridge regression on some rows says of the others, [M, K]."""
    middle, spread = x[learns].mean(0), x[learns].std(0) + 1e-3
    z = (x - middle) / spread
    own, mean = z[learns], y[learns].mean(0)
    weights = np.linalg.solve(own.T @ own + RIDGE * np.eye(z.shape[1]), own.T @ (y[learns] - mean))
    return np.asarray(z[~learns] @ weights + mean)


def _explained(said: np.ndarray, truth: np.ndarray) -> float:
    """Share of the variance of each column that is told, mean over those that vary."""
    varies = truth.var(0) > 1e-4
    missed = ((said - truth) ** 2).mean(0)[varies] / truth.var(0)[varies]
    return float(1 - missed.mean())


def main(options: FeaturesOptions) -> None:
    """Read and print.

    Raises:
        ValueError: there are fewer than two sets, or a network does not fit.
    """
    rooms = rooms_in(options.data, HEAD)
    if len(rooms) < 2:
        raise ValueError(
            f"found {len(rooms)} picture sets in {options.data}, expected two or more; make them "
            "with cfnav rooms make --views 100"
        )
    folders = [room_folder(options.data, *room) for room in rooms]
    print("| network | error of depth | of depth, told | of the floor, told |\n|---|---|---|---|")
    for path in options.perception:
        found = told(OnnxPerception(path), folders, options.cells)
        print(f"| {path} | {found.depth_error:.3f} | {found.depth:.3f} | {found.floor:.3f} |")


if __name__ == "__main__":
    sys.exit(run_options("features", FeaturesOptions, main))
