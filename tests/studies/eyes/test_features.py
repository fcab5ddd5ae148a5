"""What features tell of depth and floor."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cfnav_core.perception.picture_set import PictureSet
from cfnav_core.perception.sight import Sight
from studies.eyes.features import FeaturesOptions, main, told
from tests.core.perception.made import SMALL, picture_set


def sets(folder: Path, rooms: int = 6) -> list[Path]:
    """Rooms whose pictures are as far away and as free as their first pixel says."""
    rng, sight, out = np.random.default_rng(0), Sight.of(SMALL), []
    for seed in range(rooms):
        picture_set(folder, seed, count=300)
        (path,) = (p for p in folder.iterdir() if p.name.endswith(f"{seed:05}"))
        made = PictureSet.load(path)
        pictures, level = np.array(made.pictures), rng.integers(20, 200, 300)
        pictures[:, 0, 0] = level[:, None]
        far = np.ones((300, *sight.coarse)) * (level[:, None, None] / 50)
        PictureSet(
            pictures, made.heat, made.near, far.astype(np.float16),
            (far * 50).astype(np.uint8), objects=made.objects, camera=made.camera,
            source=made.source, states=made.states,
        ).save(path)  # fmt: skip
        out.append(path)
    return out


def test_what_is_in_the_features_is_told_and_nothing_else(tmp_path: Path) -> None:
    folders = sets(tmp_path)

    def seen(pictures: np.ndarray) -> SimpleNamespace:
        level = pictures[:, 0, 0, :1].astype(np.float16) / 255
        return SimpleNamespace(features=np.concatenate([level, np.log(level + 0.01)], 1))

    def noise(pictures: np.ndarray) -> SimpleNamespace:
        rng = np.random.default_rng(len(pictures))
        return SimpleNamespace(features=rng.random((len(pictures), 5), np.float32))

    knows, guesses = told(seen, folders), told(noise, folders)  # type: ignore[arg-type]
    assert knows.depth_error < 0.1 < guesses.depth_error
    assert knows.depth > 0.9 > 0.1 > guesses.depth
    assert knows.floor > 0.9 > 0.1 > guesses.floor
    # what is alike everywhere is told as well of larger cells
    coarse = told(seen, folders, 1)  # type: ignore[arg-type]
    assert coarse.depth_error == pytest.approx(knows.depth_error)
    assert coarse.floor == pytest.approx(knows.floor)


def test_one_room_tells_nothing_of_others(tmp_path: Path) -> None:
    sets(tmp_path, 1)
    with pytest.raises(ValueError, match=r"found 1 picture sets in .*, expected two or more"):
        main(FeaturesOptions(tmp_path, ()))
