"""Pages of rooms and models."""

from pathlib import Path

import numpy as np
from sim_bridge.data.pages import write_pages


def test_pages_of_before_are_gone(tmp_path: Path) -> None:
    page = np.zeros((8, 8, 3), np.uint8)
    (tmp_path / "notes.txt").touch()
    for count in (1001, 12, 3):
        assert write_pages([page] * count, tmp_path) == count
        names = {path.name for path in tmp_path.iterdir()}
        assert names == {"notes.txt", *(f"page_{k:03}.png" for k in range(1, count + 1))}
