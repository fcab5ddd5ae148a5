"""A recorded drive becomes a moving picture; what cannot be shown is said in one sentence."""

from __future__ import annotations

from pathlib import Path

import pytest
from cfnav_ros.bags.files.finding import BagError
from PIL import Image

from studies.bags.bag_files import drive, write
from studies.bags.drive_gif import HOLD_MS, PIXELS, GifConfig, make


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("drive") / "bag", drive(2.0))


def test_the_pictures_of_a_drive_move(bag: Path, tmp_path: Path):
    out = tmp_path / "new" / "drive.gif"
    count = make(GifConfig(bag, out, every=0.5, rate=10))
    with Image.open(out) as gif:
        assert (gif.size, gif.n_frames) == (PIXELS, count)
        lasts, looks = [], set()
        for frame in range(count):
            gif.seek(frame)
            lasts.append(gif.info["duration"])
            looks.add(gif.convert("RGB").tobytes())
    assert 3 <= count <= 6
    assert lasts == [100] * (count - 1) + [HOLD_MS]
    assert len(looks) == count


def test_a_drive_that_is_not_there_is_told(bag: Path, tmp_path: Path):
    with pytest.raises(BagError, match="holds 1 drives, --drive is 2"):
        make(GifConfig(bag, tmp_path / "drive.gif", drive=2))


def test_a_drive_without_pictures_is_told(tmp_path: Path):
    messages = [message for message in drive(1.0) if "image" not in message.topic]
    blind = write(tmp_path / "bag", messages)
    with pytest.raises(BagError, match="holds no decision with a picture"):
        make(GifConfig(blind, tmp_path / "drive.gif"))
