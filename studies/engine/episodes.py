"""Test episodes of a trained run: made once, kept one by one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfnav_core.files.provenance import commit, sha256
from cfnav_core.files.whole import whole, writing
from cfnav_core.learn.evaluate import Evaluation, evaluate
from cfnav_core.learn.run_files import BEST
from cfnav_core.task.p_hat import PHat, recorded, recorded_name

DRAWN_SEED = 2
"""Of episodes that are drawn in validation rooms; others chose the checkpoints."""

ANY = "?" * 8
"""In a file name, eight hex digits that are unknown."""


@dataclass(frozen=True)
class RunTest:
    """Which episodes test a run, and how.

    Attributes:
        p_hat: the probability that the policy is given.
        veto: the LiDAR may forbid a MoveAhead.
        sample: actions are drawn.
        frozen: file of the test episodes; None: they are drawn in validation rooms.
        most: how many of the frozen ones, from the first, all when None; or how many are drawn.
        made_of: see ``stamps.Made``; empty where only recorded results are there.
        rooms: in which episodes are drawn, as "data1:validation".
    """

    p_hat: PHat
    veto: bool
    frozen: Path | None
    most: int | None = None
    made_of: str = ""
    sample: bool = False
    rooms: str = ""

    @property
    def name(self) -> str:
        """In words, for people."""
        how = (", veto" if self.veto else "") + (", actions drawn" if self.sample else "")
        return f"test, {self.p_hat} p_hat{how}"

    @property
    def file(self) -> str:
        """Name of the results on frozen episodes."""
        assert self.frozen
        of = "" if self.most is None else f"_{self.most}"
        how = ("_veto" if self.veto else "") + ("_drawn" if self.sample else "")
        return f"{self.frozen.stem}{of}_{self.p_hat}{how}_{self.made_of}.npz"

    def result(self, run: Path) -> Path:
        """File of the results of a run.

        Those on drawn episodes bear the weights in their name, and the recorded ones stand for
        weights that are gone.
        """
        if self.frozen:
            return recorded(run / self.file)
        best = run / BEST
        weights = sha256(best)[:8] if best.exists() else ANY
        name = f"{run.name}_{weights}_{self.most}_{self.p_hat}_{self.made_of or ANY}.npz"
        folder = run.parent.parent / "p_hat" / "tests"
        names = dict.fromkeys((name, recorded_name(name)))
        found = [path for known in names for path in folder.glob(known)]
        return found[0] if len(found) == 1 else folder / name

    def run(self, run: Path, scenes: Path) -> None:
        """Test a run's best checkpoint and keep the results.

        Raises:
            CheckpointError: it is missing or damaged.
            SceneError: the scenes are not those of the run.
            WriteError: the results cannot be written.
        """
        drawn = (0, 0) if self.frozen else (self.most or 0, DRAWN_SEED)
        found = evaluate(
            run / BEST, scenes, *drawn, self.sample, p_hat=self.p_hat, frozen=self.frozen,
            veto=self.veto, most=self.most, rooms=(self.rooms,) if self.rooms else (),
        )  # fmt: skip
        path = self.result(run)
        if self.frozen:
            save_steps(found, path)
        save(found, path)


def load_steps(result: Path) -> dict[str, np.ndarray]:
    """Every step of every episode of a test.

    Returns:
        p_hat: float16 [M], what the policy was given. blocked: bool [M], MoveAhead would have
        collided. states: int32 [M], where that was, see ``SceneBank``.

    Raises:
        ValueError: they were not kept.
    """
    path = steps_of(result)
    if not path.exists():
        raise ValueError(
            f"found no {path}, the steps whose probabilities are judged; remove {result.name} "
            "beside it to test that run again"
        )
    with np.load(path, allow_pickle=False) as file:
        return dict(file.items())


def steps_of(result: Path) -> Path:
    """The file of a test's steps."""
    return result.with_suffix(".steps.npz")


def save_steps(found: Evaluation, result: Path) -> None:
    """Write the steps of an evaluation for ``load_steps``.

    Raises:
        WriteError: they cannot be written.
    """
    states = np.concatenate([step.states for step in found.trace]).astype(np.int32)
    heard = np.concatenate([step.p_hat for step in found.trace]).astype(np.float16)
    _save(steps_of(result), p_hat=heard, blocked=found.bank.collided[states], states=states)


def save(found: Evaluation, path: Path) -> None:
    """Write the episodes of an evaluation for ``Results.load``.

    Raises:
        WriteError: they cannot be written.
    """
    results = found.results
    _save(
        path,
        success=np.array([r.success for r in results]),
        collisions=np.array([r.collisions for r in results]),
        path=np.array([r.path_length for r in results]),
        shortest=np.array([r.shortest_path_length for r in results]),
        rooms=found.rooms,
        commit=np.array(found.what["commit"]),
        tested_at=np.array(commit()),
        identity=np.array(found.episodes.identity(found.bank)),
    )


def _save(file: Path, **arrays: np.ndarray) -> None:
    with writing(file):
        file.parent.mkdir(parents=True, exist_ok=True)
        with whole(file) as partial, partial.open("wb") as opened:
            np.savez_compressed(opened, **arrays)  # type: ignore[arg-type]
