"""Object-goal navigation over offline scenes as Gymnasium environments, for any learner.

    env = cfnav.make_env("out/scenes")
    many = cfnav.make_vec_env("out/scenes", num_envs=64, rooms=("kitchen:0-19",))

Observation (a dict): ``features`` float32 [*F] and ``detections`` float32 [C, D] of the perception,
``goal`` the index of the object to find, ``room`` the index of the room type. Actions: 0 MoveAhead,
1 RotateLeft, 2 RotateRight, 3 LookUp, 4 LookDown, 5 Done. Reward: -0.01 a step, 5 for Done with the
goal visible, and ``collision_penalty`` (r_c of Eq. 4) for a MoveAhead that collides. Done
terminates, the step limit truncates, a collision ends nothing. ``info``: ``collided`` of this step,
``collisions`` of the episode so far, ``success``, and ``shortest`` the fewest actions that the
start allowed, Done included.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from cfnav_core.agent.reward import nav_reward, total_reward
from cfnav_core.learn.env import ObjectNavEnv, SceneBank
from cfnav_core.task.actions import NUM_ACTIONS
from cfnav_core.task.vocabulary import ROOM_TYPES


@contextmanager
def _one_thread() -> Iterator[None]:
    """More threads than one only wait for each other over such small tensors.

    64 episodes on 2 cores at load 5.5: 280,000 to 330,000 steps/s by one thread, 3,000 to 58,000 by
    two; 1,024 episodes: 570,000 to 640,000 and 24,000 to 130,000. The learner keeps its own.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


class _Episodes:
    """B episodes with observations and infos as numpy arrays; what both environments share."""

    def __init__(
        self, scenes: Path | str, rooms: Sequence[str], batch: int, collision_penalty: float
    ) -> None:
        self.bank = SceneBank.load(Path(scenes), rooms)
        self.batch, self.penalty = batch, collision_penalty
        inputs, everything = self.bank.inputs, (-np.inf, np.inf)
        self.space = spaces.Dict({
            "features": spaces.Box(*everything, inputs.features, np.float32),
            "detections": spaces.Box(
                *everything, (len(inputs.objects), inputs.detections), np.float32
            ),
            "goal": spaces.Discrete(len(inputs.objects)),
            "room": spaces.Discrete(len(ROOM_TYPES)),
        })  # fmt: skip

    def begin(self, rng: np.random.Generator) -> None:
        self.env = ObjectNavEnv(self.bank, self.batch, rng)
        self.shortest = self._fewest()

    def observation(self) -> dict[str, np.ndarray]:
        features, detections = self.env.observe()
        state = self.env.state.numpy()
        return {
            "features": features.numpy(), "detections": detections.numpy(),
            "goal": self.env.goal.numpy().copy(), "room": self.bank.room[state],
        }  # fmt: skip

    def act(self, action: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Reward, terminated, truncated [B] and info of a step; nothing starts again yet."""
        done = self.env.step(torch.as_tensor(action, dtype=torch.int64))
        reward = total_reward(nav_reward(done.success), done.collided, self.penalty)
        info = self.info() | {"collided": done.collided.numpy(), "success": done.success.numpy()}
        return reward.numpy(), done.terminated.numpy(), done.truncated.numpy(), info

    def info(self) -> dict[str, Any]:
        none = np.zeros(self.batch, bool)
        return {
            "collided": none, "success": none, "shortest": self.shortest.copy(),
            "collisions": np.array(self.env.collisions.tolist(), np.int64),
        }  # fmt: skip

    def restart(self, ended: np.ndarray) -> None:
        self.env.restart(torch.from_numpy(ended))
        self.shortest = np.where(ended, self._fewest(), self.shortest)

    def _fewest(self) -> np.ndarray:
        state, goal = self.env.state.numpy(), self.env.goal.numpy()
        return self.bank.actions_to[state, goal].astype(np.int64) + 1


class ObjectNav(gymnasium.Env[Any, Any]):
    """One episode at a time. See the module for the specification.

    Args:
        scenes: folder of scenes, or a packed store.
        rooms: see ``scenes.select.scene_names``; every scene when empty.
        collision_penalty: r_c.

    Raises:
        SceneError: the scenes cannot be used.
    """

    def __init__(
        self, scenes: Path | str, rooms: Sequence[str] = (), collision_penalty: float = 0.0
    ) -> None:
        self.metadata = {"render_modes": []}
        self._episodes = _Episodes(scenes, rooms, 1, collision_penalty)
        self.observation_space = self._episodes.space
        self.action_space = spaces.Discrete(NUM_ACTIONS)

    @_one_thread()
    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Begin an episode; a seed makes all that follow repeatable."""
        super().reset(seed=seed)
        self._episodes.begin(self.np_random)
        return _first(self._episodes.observation()), _first(self._episodes.info())

    @_one_thread()
    def step(self, action: int) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """Act."""
        reward, terminated, truncated, info = self._episodes.act(np.array([action]))
        ends = bool(terminated[0]), bool(truncated[0])
        return _first(self._episodes.observation()), float(reward[0]), *ends, _first(info)


class ObjectNavVector(VectorEnv[Any, Any, Any]):
    """Many episodes at once, each begun again in the step in which it ends.

    Gymnasium's same-step mode: observation and infos are those of the new episode; the last ones of
    the old episode stand under ``final_obs`` and ``final_info``. A mask ``_name`` beside each info
    says which episodes have it.

    Args:
        scenes: see ``ObjectNav``. rooms: see there. collision_penalty: see there.
        num_envs: B.
    """

    def __init__(
        self, scenes: Path | str, num_envs: int = 1, rooms: Sequence[str] = (),
        collision_penalty: float = 0.0,
    ) -> None:  # fmt: skip
        self._episodes = _Episodes(scenes, rooms, num_envs, collision_penalty)
        self.metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}
        self.num_envs = num_envs
        self.single_observation_space = self._episodes.space
        self.single_action_space = spaces.Discrete(NUM_ACTIONS)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    @_one_thread()
    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Begin B episodes; a seed makes all that follow repeatable."""
        super().reset(seed=seed)
        self._episodes.begin(self.np_random)
        return self._episodes.observation(), self._masked(self._episodes.info())

    @_one_thread()
    def step(
        self, actions: np.ndarray
    ) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Act in every episode."""
        reward, terminated, truncated, info = self._episodes.act(actions)
        ended = terminated | truncated
        if ended.any():
            last, last_info = self._episodes.observation(), self._masked(info, ended)
            final = np.full(self.num_envs, None, dtype=object)
            for i in np.nonzero(ended)[0]:
                final[i] = {k: v[i] for k, v in last.items()}
            self._episodes.restart(ended)
            begun = self._episodes.info()
            info = {k: np.where(ended, begun[k], v) for k, v in info.items()}
            finals = {"final_obs": final, "final_info": last_info}
            info = self._masked(info) | self._masked(finals, ended)
        else:
            info = self._masked(info)
        return self._episodes.observation(), reward, terminated, truncated, info

    def _masked(self, info: dict[str, Any], mask: np.ndarray | None = None) -> dict[str, Any]:
        """Infos with their masks; every episode has them when there is no mask."""
        has = np.ones(self.num_envs, bool) if mask is None else mask
        return info | {f"_{k}": has for k in info}


def _first(rows: dict[str, np.ndarray]) -> dict[str, Any]:
    """The only episode's; single numbers as Gymnasium's spaces want them."""
    return {k: v[0] for k, v in rows.items()}
