"""Test episodes of a run: made once, kept episode by episode."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfnav_core.config import PHat
from cfnav_core.evaluate import LONG_EPISODE, Evaluation, evaluate
from cfnav_core.run_files import BEST
from cfnav_core.source import commit
from cfnav_core.whole import whole, writing


@dataclass(frozen=True)
class FrozenTest:
    """Which test.

    Attributes:
        p_hat: the probability that the policy is given.
        veto: the LiDAR may forbid a MoveAhead.
        sample: actions are drawn.
        frozen: file of the test episodes.
        most: how many of them, from the first; all when None.
        made_of: see ``stamps.Made``.
    """

    p_hat: PHat
    veto: bool
    frozen: Path
    most: int | None = None
    made_of: str = ""
    sample: bool = False

    @property
    def file(self) -> str:
        """Name of its results in the run's folder."""
        of = "" if self.most is None else f"_{self.most}"
        how = ("_veto" if self.veto else "") + ("_drawn" if self.sample else "")
        return f"{self.frozen.stem}{of}_{self.p_hat}{how}_{self.made_of}.npz"

    @property
    def name(self) -> str:
        """In words, for people."""
        how = (", veto" if self.veto else "") + (", actions drawn" if self.sample else "")
        return f"test, {self.p_hat} p_hat{how}"


@dataclass(frozen=True)
class Tested:
    """Results of one run, episode by episode.

    Attributes:
        success: bool [N]. collisions: int64 [N].
        path: float64 [N], actions, Done included. shortest: float64 [N].
        rooms: [N], names of the rooms.
        commit: of the code that trained it. tested_at: of the code that tested it.
        identity: of the episodes.
    """

    success: np.ndarray
    collisions: np.ndarray
    path: np.ndarray
    shortest: np.ndarray
    rooms: np.ndarray
    commit: str
    tested_at: str
    identity: str

    @property
    def long(self) -> np.ndarray:
        """Bool [N], episodes whose shortest way has at least ``LONG_EPISODE`` actions."""
        return self.shortest >= LONG_EPISODE

    @property
    def cf_success(self) -> np.ndarray:
        """float64 [N], S_i of Eq. 1."""
        return (self.success & (self.collisions == 0)).astype(float)

    @property
    def cf_efficiency(self) -> np.ndarray:
        """float64 [N], the terms of CF-SPL."""
        return self.cf_success * self.shortest / np.maximum(self.path, self.shortest)

    @classmethod
    def load(cls, path: Path) -> Tested:
        """Read what ``run_test`` wrote.

        Raises:
            ValueError: it is not there.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                found = dict(file.items())
        except OSError as error:
            raise ValueError(f"found no readable results in {path} ({error}); test it") from error
        return cls(
            **found | {name: str(found[name]) for name in ("commit", "tested_at", "identity")}
        )


@dataclass(frozen=True)
class Steps:
    """Every step of every episode of a test.

    Attributes:
        p_hat: float16 [M], what the policy was given.
        blocked: bool [M], MoveAhead would have collided.
        states: int32 [M], where that was, see ``SceneBank``.
    """

    p_hat: np.ndarray
    blocked: np.ndarray
    states: np.ndarray

    @classmethod
    def load(cls, result: Path) -> Steps:
        """Those beside a test's results.

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
            return cls(**file)


def steps_of(result: Path) -> Path:
    """The file of a test's steps."""
    return result.with_suffix(".steps.npz")


def run_test(test: FrozenTest, folder: Path, scenes: Path) -> None:
    """Test a run's best checkpoint.

    Raises:
        CheckpointError: it is missing or damaged.
        SceneError: the scenes are not those of the run.
        WriteError: the results cannot be written.
    """
    found = evaluate(
        folder / BEST, scenes, 0, 0, test.sample, p_hat=test.p_hat, frozen=test.frozen,
        veto=test.veto, most=test.most,
    )  # fmt: skip
    save(found, folder / test.file)


def save(found: Evaluation, path: Path) -> None:
    """Write an evaluation for ``Tested.load``, and its steps, if it kept them, for ``Steps.load``.

    Raises:
        WriteError: the results cannot be written.
    """
    results = found.results
    if found.trace:
        states = np.concatenate([step.states for step in found.trace]).astype(np.int32)
        heard = np.concatenate([step.p_hat for step in found.trace]).astype(np.float16)
        of = steps_of(path)
        with writing(of), whole(of) as partial, partial.open("wb") as file:
            np.savez_compressed(
                file, p_hat=heard, blocked=found.bank.collided[states], states=states
            )
    with writing(path), whole(path) as partial, partial.open("wb") as file:
        np.savez_compressed(
            file,
            success=np.array([r.success for r in results]),
            collisions=np.array([r.collisions for r in results]),
            path=np.array([r.path_length for r in results]),
            shortest=np.array([r.shortest_path_length for r in results]),
            rooms=found.rooms,
            commit=np.array(found.what["commit"]),
            tested_at=np.array(commit()),
            identity=np.array(found.episodes.identity(found.bank)),
        )
