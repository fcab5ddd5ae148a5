"""Damage at random: what is read is true, or what is wrong is said."""

from __future__ import annotations

import random
import shutil
import time
from pathlib import Path

import pytest

from studies.bags.bag_files import BY_FILE, SQLITE, drive, write, write_mcap
from studies.bags.fuzz import mutated, read

DRIVE = drive()


@pytest.fixture(scope="module")
def expected(tmp_path_factory) -> list[tuple]:
    events, notes = read(write(tmp_path_factory.mktemp("whole") / "bag", DRIVE))
    assert notes == []
    return events


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> dict[str, Path]:
    """Bags of one file, by the end of its name."""
    folder = tmp_path_factory.mktemp("files")
    return {
        "mcap": write_mcap(folder / "bag.mcap", DRIVE),
        "db3": write(folder / "plain", DRIVE, SQLITE),
        "db3.zstd": write(folder / "zipped", DRIVE, SQLITE, BY_FILE),
    }


@pytest.mark.parametrize("seed", range(300))
def test_a_damaged_mcap_gives_true_events_or_says_what_is_wrong(tmp_path, expected, whole, seed):
    file = tmp_path / "bag.mcap"
    file.write_bytes(mutated(whole["mcap"].read_bytes(), random.Random(seed)))
    began = time.process_time()
    events, notes = read(file)
    assert time.process_time() - began < 20
    assert set(events) <= set(expected)
    if events != expected:
        assert notes


@pytest.mark.parametrize("suffix", ["db3", "db3.zstd"])
@pytest.mark.parametrize("seed", range(100))
def test_a_damaged_database_gives_no_invented_message(tmp_path, expected, whole, seed, suffix):
    """sqlite has no checksums: bytes flipped within a picture cannot be told from true ones."""
    bag = tmp_path / "bag"
    shutil.copytree(whole[suffix], bag)
    (file,) = (path for path in bag.iterdir() if path.name != "metadata.yaml")
    file.write_bytes(mutated(file.read_bytes(), random.Random(seed)))
    began = time.process_time()
    events, notes = read(bag)
    assert time.process_time() - began < 20
    assert len(set(events) - set(expected)) <= 10
    if len(events) != len(expected):
        assert notes
    assert all(note.endswith(".") and "\n" not in note for note in notes)
