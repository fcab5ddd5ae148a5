"""What p_hat is: the collision probability that a policy is given at a decision.

Every kind is one row that says where it comes from, what it needs and how it is made. Training,
evaluation, bags and the robot make it here and nowhere else.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any, Literal, cast

import numpy as np

PHat = Literal["own", "lidar", "both", "zero", "true", "other_episode", "earlier"]
"""A row of ``SOURCES``."""

TESTED: tuple[PHat, ...] = ("own", "zero", "other_episode", "true", "lidar", "both")
"""What a policy can be given in episodes over offline scenes, where no drive goes before."""

DRIVEN: tuple[PHat, ...] = ("lidar", "own", "both", "zero", "earlier")
"""What it can be given on a robot, where nobody knows the truth and no other episode runs."""

FORMERLY = "shuffled"
"""What ``other_episode`` and ``earlier`` were both called, also in results recorded until then."""


@dataclass(frozen=True)
class Known:
    """What is known where N agents decide: arrays [N] of numbers 0 to 1, numpy's or torch's.

    Attributes:
        zero: zeros.
        own: asks the policy's own predictor, whose memory advances by that.
        lidar: what the LiDAR says.
        truth: 1 where a MoveAhead would collide.
        mixed: puts the values of N agents in N episodes in another order.
        earlier: what the LiDAR said at the decisions of the drive before this one.
    """

    zero: Any
    own: Callable[[], Any] | None = None
    lidar: Any = None
    truth: Any = None
    mixed: Callable[[Any], Any] | None = None
    earlier: Sequence[Any] | None = None


@dataclass(frozen=True)
class PHatSource:
    """One kind of p_hat.

    Attributes:
        comes_from: in words, to follow "from".
        needs: fields of ``Known``.
        make: p_hat [N] of what is known.
    """

    comes_from: str
    needs: tuple[str, ...]
    make: Callable[[Any], Any]


def _any_so_far(known: Any) -> Any:
    # by the number of the decision alone, so that a bag of the drive repeats it
    return Random(len(known.earlier)).choice((*known.earlier, known.lidar))


SOURCES: Mapping[PHat, PHatSource] = {
    "own": PHatSource("the policy's own predictor", ("own",), lambda k: k.own()),
    "lidar": PHatSource("the LiDAR", ("lidar",), lambda k: k.lidar),
    "both": PHatSource(
        "the LiDAR or the policy's own predictor, whichever says more", ("lidar", "own"),
        lambda k: np.maximum(k.lidar, k.own()),
    ),
    "zero": PHatSource("nowhere (zero)", (), lambda k: k.zero),
    "true": PHatSource("the simulator, which knows the truth", ("truth",), lambda k: k.truth),
    "other_episode": PHatSource(
        "the policy's own predictor in another episode", ("own", "mixed"),
        lambda k: k.mixed(k.own()),
    ),
    "earlier": PHatSource(
        "the LiDAR at any decision of the drive so far", ("lidar", "earlier"), _any_so_far
    ),
}  # fmt: skip


def make_p_hat(kind: PHat, known: Known) -> Any:
    """p_hat [N] of one decision.

    Raises:
        ValueError: something that this kind needs is not known.
    """
    source = SOURCES[kind]
    missing = [name for name in source.needs if getattr(known, name) is None]
    if missing:
        raise ValueError(
            f"p_hat is {kind!r}, which comes from {source.comes_from}, but nothing is known here "
            f"of {' and '.join(missing)}; give it, or choose another p_hat"
        )
    return source.make(known)


def needs_lidar(kind: PHat) -> bool:
    """Whether the LiDAR has a part in it."""
    return "lidar" in SOURCES[kind].needs


def check_kind(kind: str, among: Sequence[PHat]) -> PHat:
    """The same word, known to be one of those that make sense here.

    Raises:
        ValueError: it is not, or it is the word that meant two of them.
    """
    if kind in among:
        return cast(PHat, kind)
    names = f"{', '.join(among[:-1])} or {among[-1]}"
    if kind == FORMERLY:
        raise ValueError(
            f"p_hat is {FORMERLY!r}, which meant two things: in offline episodes it is now "
            "other_episode (its own prediction of another episode), on a robot earlier (the "
            f"LiDAR's of any decision so far). Here it may be {names}."
        )
    raise ValueError(f"p_hat is {kind!r}, expected {names}.")


def recorded_name(name: str) -> str:
    """What a file that is named by its kind is called where it was recorded under ``FORMERLY``."""
    return name.replace("other_episode", FORMERLY).replace("earlier", FORMERLY)


def recorded(path: Path) -> Path:
    """A file of results that is named by its kind, under the name that it has or will have."""
    before = path.with_name(recorded_name(path.name))
    return before if before.exists() and not path.exists() else path
