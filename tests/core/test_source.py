"""Identity of source code, and notes of what made a file."""

from __future__ import annotations

from pathlib import Path

import pytest

from cfnav_core.source import commit, made_by, sign, source_identity

CODE = """
def f(x: int) -> int:
    return x + 1
"""
SAME = '''
"""A module."""

def f(x: int) -> int:
    """Add one."""
    return (x
            + 1)  # one
'''


def identity(folder: Path, text: str) -> str:
    (folder / "code.py").write_text(text)
    return source_identity([folder / "code.py"])


def test_only_what_code_does_counts(tmp_path: Path) -> None:
    first = identity(tmp_path, CODE)
    assert identity(tmp_path, SAME) == first
    assert len(first) == 16


@pytest.mark.parametrize(
    ("before", "after"), [("x + 1", "x + 2"), ("x + 1", "1 + x"), ("-> int", "-> None"),
                          ("return x", "return -x"), ("x: int", "x: int = 0")],
)  # fmt: skip
def test_other_code_has_another_identity(tmp_path: Path, before: str, after: str) -> None:
    assert identity(tmp_path, CODE.replace(before, after)) != identity(tmp_path, CODE)


def test_it_is_the_same_in_every_python(tmp_path: Path) -> None:
    text = 'class A:\n    x = f"{1!r:>{3}}" or None\n'
    assert identity(tmp_path, text + CODE) == "ca08bc81c56af835"


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
