"""Notes of what a file was made of, hashes and the commit."""

from __future__ import annotations

from pathlib import Path

from cfnav_core.files.provenance import commit, made_by, sha256, sign


def test_a_file_says_what_made_it(tmp_path: Path) -> None:
    path = tmp_path / "lidar.npy"
    assert made_by(path) == ""
    path.touch()
    assert made_by(path) == "unknown"
    sign(path, "this")
    assert made_by(path) == "this"
    path.unlink()
    assert made_by(path) == ""


def test_the_commit_is_one_word() -> None:
    assert commit().split() == [commit()]


def test_a_hash_is_that_of_the_bytes(tmp_path: Path) -> None:
    path = tmp_path / "abc"
    path.write_bytes(b"abc")
    assert sha256(path).startswith("ba7816bf8f01cfea414140de5dae2223")
