"""Lines are counted, compared with an earlier revision, and forbidden imports are told."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from studies import house

SOURCE = '''"""What this is.

Told at length.
"""

# A reason.
WORDS = """two
lines"""
"""What the words are."""


def empty() -> None:
    """Do nothing."""
    ...
'''


def test_code_is_counted_without_docstrings_comments_and_empty_lines():
    assert house.size_of(SOURCE) == house.Size(files=1, code=4, lines=14)


@pytest.mark.parametrize(
    ("path", "package"),
    [
        ("cfnav_ros/cfnav_ros/ros/graph.py", "cfnav_ros"),
        ("cfnav_core/task/actions.py", "cfnav_core"),
        ("cfnav_core/setup.py", None),
        ("cfnav_ros/setup.py", None),
        ("tests/conftest.py", None),
        ("studies/README.md", None),
    ],
)
def test_a_file_belongs_to_a_package(path, package):
    assert house.package_of(path) == package


@pytest.fixture
def small_house(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository of one package in one folder, and one test."""
    monkeypatch.setattr(house, "ROOT", tmp_path)
    monkeypatch.setattr(house, "PACKAGES", {"studies": tmp_path / "studies"})
    for folder in ("studies", "tests"):
        (tmp_path / folder).mkdir()
    (tmp_path / "studies/__init__.py").write_text('"""Studies.\n\nMay import: torch.\n"""\n')
    (tmp_path / "studies/one.py").write_text("import torch\nimport ray\nimport tests.two\n")
    (tmp_path / "tests/two.py").write_text("ONE = 1\nTWO = 2\nTHREE = 3\n")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    git(tmp_path, "-c", "user.name=a", "-c", "user.email=a@b.c", "commit", "-qm", "first")
    return tmp_path


def git(folder: Path, *arguments: str) -> None:
    subprocess.run(["git", *arguments], cwd=folder, check=True, timeout=60)


def test_an_earlier_revision_is_counted(small_house: Path):
    (small_house / "studies/one.py").write_text("")
    assert house.sizes_at("HEAD") == {"studies": house.Size(files=2, code=3, lines=7)}


def test_what_came_from_tests_is_found(small_house: Path):
    git(small_house, "mv", "tests/two.py", "studies/two.py")
    assert house.came_from_tests("HEAD") == {small_house / "studies/two.py"}


def test_an_unknown_revision_is_told(small_house: Path):
    with pytest.raises(ValueError, match=r"git ls-tree failed: .*nowhere"):
        house.sizes_at("nowhere")


def test_a_forbidden_import_is_told(small_house: Path, monkeypatch: pytest.MonkeyPatch):
    found = house.modules()
    monkeypatch.setattr(house, "MODULES", found)
    monkeypatch.setattr(house, "FOLDERS", {"studies": found["studies"]})
    assert list(house.forbidden_imports("studies.one")) == [
        "studies.one imports ray, which the docstring of studies does not allow",
        "studies.one imports tests.two, and tests are imported by tests alone",
    ]
