"""A Gymnasium vector as a vector of Stable-Baselines3, which has its own interface for them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from cfnav_core.learn.gym_env import ObjectNavVector


class Sb3Vector(VecEnv):
    """``ObjectNavVector`` for Stable-Baselines3.

    Both begin an episode again in the step in which it ends, so only names and places differ: the
    last observation of an episode goes into its info, and infos are one dict an episode.
    """

    def __init__(self, env: ObjectNavVector) -> None:
        self.env = env
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    def reset(self) -> dict[str, np.ndarray]:
        """Begin all episodes, with the seed of ``seed`` the first time after it."""
        observation, info = self.env.reset(seed=self._seeds[0])
        self.reset_infos = [self._row(info, i) for i in range(self.num_envs)]
        self._reset_seeds()
        return observation

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions of the next step."""
        self._actions = actions

    def step_wait(self) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, list[Any]]:
        """Act in every episode."""
        observation, reward, terminated, truncated, info = self.env.step(self._actions)
        ended = terminated | truncated
        infos = [
            self._row(info["final_info"] if ended[i] else info, i) for i in range(self.num_envs)
        ]
        for i in np.flatnonzero(ended):
            infos[i]["terminal_observation"] = info["final_obs"][i]
            infos[i]["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
        return observation, reward, ended, infos

    def _row(self, info: dict[str, Any], i: int) -> dict[str, Any]:
        """One episode's infos; a mask, or what only ended episodes have, is none."""
        return {name: info[name][i] for name in ("collided", "success", "shortest", "collisions")}

    def close(self) -> None:
        """Nothing is open."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute, which all episodes share."""
        return [getattr(self.env, attr_name)] * len(self._rows(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute, which all episodes share."""
        setattr(self.env, attr_name, value)

    def env_method(
        self, method_name: str, *arguments: Any, indices: Any = None, **named: Any
    ) -> list[Any]:
        """Call a method once, as all episodes share it."""
        return [getattr(self.env, method_name)(*arguments, **named)] * len(self._rows(indices))

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """No episode has a wrapper of its own."""
        return [False] * len(self._rows(indices))

    def _rows(self, indices: Any) -> Sequence[int]:
        return list(self._get_indices(indices))
