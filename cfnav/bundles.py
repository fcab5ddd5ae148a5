"""Bundles in one line each: load one and act, test one, compare two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cfnav_core.policy.bundle import shipped_bundle
from cfnav_core.policy.networks import Backend
from cfnav_core.policy.policy import Policy
from cfnav_core.task.intervals import ends_text

if TYPE_CHECKING:
    from cfnav_core.learn.evaluate import Evaluation
    from cfnav_core.task.p_hat import PHat


def load(
    bundle: Path | str | None = None,
    goal: str | None = None,
    backend: Backend = "onnx",
    sample_seed: int | None = None,
    room_type: str = "",
) -> Policy:
    """A bundle that acts.

    Args:
        bundle: its folder, or the name of a shipped one; the default when None.
        goal: begins an episode at once; else the first ``act`` or ``reset`` names one.
        backend: what runs the networks; torch needs torch.
        sample_seed: draws actions; the most probable one is taken when None.
        room_type: where it is, such as kitchen; only bundles that look it up need it.

    Raises:
        BundleError: it cannot be used.
        ValueError: it does not take the goal, or the type of room.
    """
    policy = Policy.load(bundle, backend, sample_seed, room_type)
    if goal is not None:
        policy.reset(goal)
    return policy


def evaluate(
    bundle: Path | str | None = None,
    scenes: Path | str = "out/scenes",
    rooms: Sequence[str] = (),
    episodes: int = 1000,
    seed: int = 0,
    frozen: Path | str | None = None,
    p_hat: PHat = "own",
    veto: bool = False,
    sample: bool = False,
) -> Evaluation:
    """Run a bundle or a checkpoint on frozen episodes over offline scenes (needs torch).

    Args:
        bundle: as for ``load``, or a checkpoint such as best.safetensors.
        scenes: folder of scenes made with its perception, or a store.
        rooms: TYPE:FIRST-LAST or a split such as data2:test; every scene when empty.
        episodes: how many are drawn.
        seed: draws starts and goals, and actions when they are drawn.
        frozen: a file of episodes (cfnav data freeze) instead of drawn ones.
        p_hat: what the policy is given as collision probability, see ``task.p_hat.TESTED``.
        veto: the LiDAR may forbid a MoveAhead, as on the robot.
        sample: draw actions instead of taking the most probable one.

    Raises:
        BundleError, CheckpointError, SceneError: what was given cannot be used.
    """
    from cfnav_core.learn.evaluate import evaluate

    return evaluate(
        Path(bundle or shipped_bundle()), Path(scenes), episodes, seed, sample, p_hat, rooms,
        Path(frozen) if frozen else None, veto,
    )  # fmt: skip


@dataclass(frozen=True, repr=False)
class Comparison:
    """Two evaluations of the same episodes.

    Attributes:
        difference: CF-SR of ``a`` minus that of ``b``.
        interval: its 95 % interval, over rooms; None where it cannot be told.
        why: why not, part of a sentence; empty where it can.
    """

    a: Evaluation
    b: Evaluation
    difference: float
    interval: tuple[float, float] | None
    why: str = ""

    def __repr__(self) -> str:
        ends = ends_text(self.interval, self.why, "+")
        return (
            f"<CF-SR {self.difference:+.3f} {ends} of {len(self.a.results)} "
            f"episodes: {self.a} against {self.b}>"
        )


def compare(
    a: Path | str | None, b: Path | str | None, scenes: Path | str = "out/scenes", **same: Any
) -> Comparison:
    """Run two bundles or checkpoints on the same frozen episodes; ``same`` as for ``evaluate``."""
    from cfnav_core.learn.evaluate import paired_difference

    first, second = (evaluate(bundle, scenes, **same) for bundle in (a, b))
    found = paired_difference(first, second)
    return Comparison(first, second, found["cf_sr_difference"], found["interval"], found["why"])
