"""The set-up's steps: done once, again when their inputs change, afresh after interruptions."""

from __future__ import annotations

from pathlib import Path

import pytest


class Counted:
    """A step whose runs are counted; it makes its product from its input."""

    def __init__(self, steps, folder: Path) -> None:
        self.runs = self.undone = 0
        self.source, self.product = folder / "source", folder / "product"
        self.source.write_text("one")
        self.failure: BaseException | None = None
        self.step = steps.Step(
            "copy", "Copying", self.product, [self.source, "word"], self.run, self.undo
        )

    def run(self) -> None:
        self.runs += 1
        self.product.write_text("half")
        if self.failure is not None:
            raise self.failure
        self.product.write_text(self.source.read_text())

    def undo(self) -> None:
        self.undone += 1
        self.product.unlink(missing_ok=True)


@pytest.fixture
def counted(steps, tmp_path):
    return Counted(steps, tmp_path)


def ensure(steps, tmp_path, counted):
    """One run of the set-up: a new process knows nothing but the stamps."""
    stamps = steps.Stamps(tmp_path / "stamps")
    stamps.recover([counted.step])
    return stamps.ensure(counted.step, lambda line: None)


def test_a_step_runs_once(steps, tmp_path, counted):
    assert [ensure(steps, tmp_path, counted) for _ in range(3)] == [True, False, False]
    assert counted.runs == 1


def test_a_changed_input_runs_it_again(steps, tmp_path, counted):
    ensure(steps, tmp_path, counted)
    counted.source.write_text("two")
    assert ensure(steps, tmp_path, counted)
    assert counted.product.read_text() == "two"


def test_a_lost_product_runs_it_again(steps, tmp_path, counted):
    ensure(steps, tmp_path, counted)
    counted.product.unlink()
    assert ensure(steps, tmp_path, counted)


def test_an_interrupted_step_is_undone_and_done_afresh(steps, tmp_path, counted):
    counted.failure = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        ensure(steps, tmp_path, counted)
    assert counted.product.read_text() == "half"
    counted.failure = None
    assert ensure(steps, tmp_path, counted)
    assert (counted.undone, counted.product.read_text()) == (1, "one")
    assert not ensure(steps, tmp_path, counted)


def test_a_killed_step_with_an_old_stamp_is_not_taken_for_done(steps, tmp_path, counted):
    ensure(steps, tmp_path, counted)
    counted.source.write_text("two")
    counted.failure = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        ensure(steps, tmp_path, counted)
    counted.source.write_text("one")  # the inputs of the old stamp again
    counted.failure = None
    assert ensure(steps, tmp_path, counted)
    assert counted.product.read_text() == "one"


def test_a_failed_step_is_tried_again_without_undoing(steps, tmp_path, counted):
    counted.failure = steps.SetupError("no network")
    with pytest.raises(steps.SetupError):
        ensure(steps, tmp_path, counted)
    counted.failure = None
    assert ensure(steps, tmp_path, counted)
    assert counted.undone == 0


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
