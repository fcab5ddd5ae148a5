"""Object-goal navigation as Gymnasium environments; ``cfnav_core.learn.gym_env`` specifies them.

``gymnasium.make("cfnav/ObjectNav-v0", scenes=...)`` makes the same after ``import cfnav``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv

    from cfnav_core.learn.gym_env import ObjectNavVector


def make_env(
    scenes: Path | str = "out/scenes", rooms: Sequence[str] = (), collision_penalty: float = 0.0
) -> gymnasium.Env[Any, Any]:
    """One episode at a time, as Stable-Baselines3 takes it.

    Args:
        scenes: folder of scenes, or a store.
        rooms: TYPE:FIRST-LAST or a split such as data2:train; every scene when empty.
        collision_penalty: r_c of Eq. 4, added when a MoveAhead collides.

    Raises:
        SceneError: the scenes cannot be used.
    """
    return gymnasium.make(
        "cfnav/ObjectNav-v0", scenes=scenes, rooms=rooms, collision_penalty=collision_penalty
    )


def make_vec_env(
    scenes: Path | str = "out/scenes", num_envs: int = 64, rooms: Sequence[str] = (),
    collision_penalty: float = 0.0,
) -> ObjectNavVector:  # fmt: skip
    """Many episodes at once, as a Gymnasium vector; arguments as for ``make_env``."""
    from cfnav_core.learn.gym_env import ObjectNavVector

    return ObjectNavVector(scenes, num_envs, rooms, collision_penalty)


def make_sb3_env(
    scenes: Path | str = "out/scenes", num_envs: int = 64, rooms: Sequence[str] = (),
    collision_penalty: float = 0.0,
) -> VecEnv:  # fmt: skip
    """The vector of ``make_vec_env`` as Stable-Baselines3 takes vectors, with its monitor."""
    from stable_baselines3.common.vec_env import VecMonitor

    from cfnav.sb3 import Sb3Vector

    return VecMonitor(Sb3Vector(make_vec_env(scenes, num_envs, rooms, collision_penalty)))
