"""The set-up's steps: done once, again when their inputs change, afresh after interruptions."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest


class Counted:
    """A step whose runs are counted; it makes its product from its input."""

    def __init__(self, steps, folder: Path) -> None:
        self.runs = 0
        self.source, self.product = folder / "source", folder / "made/product"
        self.source.write_text("one")
        self.failure: BaseException | None = None
        stamp = folder / "made/stamp"
        self.step = steps.Step("Copying", stamp, [self.source, "word"], self.run)

    def run(self) -> None:
        self.runs += 1
        self.product.write_text("half")
        if self.failure is not None:
            raise self.failure
        self.product.write_text(self.source.read_text())

    def ensure(self) -> bool:
        return self.step.ensure(lambda line: None)


@pytest.fixture
def counted(steps, tmp_path):
    return Counted(steps, tmp_path)


def test_a_step_runs_once(counted):
    assert [counted.ensure() for _ in range(3)] == [True, False, False]
    assert counted.runs == 1


def test_a_changed_input_runs_it_again(counted):
    counted.ensure()
    counted.source.write_text("two")
    assert counted.ensure()
    assert counted.product.read_text() == "two"


def test_a_deleted_folder_runs_it_again(counted):
    counted.ensure()
    shutil.rmtree(counted.product.parent)
    assert counted.ensure()


def test_an_interrupted_step_is_known_as_such_and_never_taken_for_done(counted):
    counted.ensure()
    counted.source.write_text("two")
    counted.failure = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        counted.ensure()
    counted.source.write_text("one")  # the inputs of the old stamp again
    counted.failure = None
    assert counted.step.interrupted()
    assert counted.ensure()
    assert counted.product.read_text() == "one"
    assert not counted.step.interrupted()


def test_a_failed_step_is_tried_again_and_was_not_interrupted(steps, counted):
    counted.failure = steps.SetupError("no network")
    with pytest.raises(steps.SetupError):
        counted.ensure()
    assert not counted.step.interrupted()
    counted.failure = None
    assert counted.ensure()


def test_the_digest_sees_names_and_contents_but_not_caches(steps, tmp_path):
    (tmp_path / "a").write_text("x")
    before = steps.digest([tmp_path])
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__/a.pyc").write_text("compiled")
    assert steps.digest([tmp_path]) == before
    (tmp_path / "a").rename(tmp_path / "b")
    renamed = steps.digest([tmp_path])
    (tmp_path / "b").write_text("y")
    assert len({before, renamed, steps.digest([tmp_path])}) == 3
