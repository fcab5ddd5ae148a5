"""``ObjectNavEnv``: many object-goal episodes at once over offline scenes.

Observation of each episode: the perception's features and detections of its state, and the goal.
Actions: ``actions.Action``. MoveAhead without an edge leaves the state as it is and is a
collision. Done ends the episode, with success when the goal is visible; so does the step limit
(``truncated``). Collisions do not end an episode. Randomness enters through the given generator.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from cfnav_core.actions import Action
from cfnav_core.scene import HORIZONS, OfflineScene, SceneError
from cfnav_core.vocabulary import CATEGORIES

STEP_LIMIT = 100
LIVING_ROOM_STEP_LIMIT = 200
MIN_GOAL_STATES = 4
"""A goal seen from fewer states of a room is not asked for there."""


def step_limit(room_type: str) -> int:
    """Most actions of an episode, Done included: the lineage's 100, 200 in living rooms."""
    return LIVING_ROOM_STEP_LIMIT if room_type == "living_room" else STEP_LIMIT


@dataclass(frozen=True)
class Task:
    """One goal in one scene: ``starts`` are its level states (int64) that do not see it yet."""

    goal: int
    starts: np.ndarray


class SceneBank:
    """Scenes joined into one table of states.

    Args:
        scenes: at least one, all made with the same perception.

    Raises:
        SceneError: no scenes, mixed perceptions, or no goal that can be reached.
    """

    def __init__(self, scenes: list[OfflineScene]) -> None:
        if not scenes:
            raise SceneError("found no scenes; make some with python -m sim_bridge.dataset")
        made_with = {s.perception for s in scenes}
        if len(made_with) > 1:
            raise SceneError(
                f"found scenes of {len(made_with)} perceptions ({', '.join(sorted(made_with))}); "
                "make all of them with the same one"
            )
        self.perception = scenes[0].perception
        self.names = [s.name for s in scenes]
        sizes = [s.num_states for s in scenes]
        offsets = np.cumsum([0, *sizes])
        self.scene = np.repeat(np.arange(len(scenes)), sizes)
        self.features = np.concatenate([s.features for s in scenes])
        self.detections = np.concatenate([s.detections for s in scenes])
        self.next_state = np.concatenate(
            [np.asarray(s.next_state, np.int64) + o for s, o in zip(scenes, offsets, strict=False)]
        )
        self.collided = np.concatenate([s.collided for s in scenes])
        self.visible = np.concatenate([s.visible for s in scenes])
        self.step_limit = np.repeat([step_limit(s.room_type) for s in scenes], sizes)
        self.actions_to = np.full((offsets[-1], len(CATEGORIES)), -1, np.int16)
        self.tasks = [
            t for s, o in zip(scenes, offsets, strict=False) for t in self._tasks(s, int(o))
        ]
        if not self.tasks:
            raise SceneError(f"found no goal that can be reached in {', '.join(self.names)}")

    def _tasks(self, scene: OfflineScene, offset: int) -> list[Task]:
        tasks = []
        for goal in np.nonzero(scene.visible.sum(0) >= MIN_GOAL_STATES)[0]:
            distance = scene.actions_to(int(goal))
            self.actions_to[offset : offset + scene.num_states, goal] = distance
            level = np.arange(scene.num_states) % HORIZONS == 0
            starts = np.nonzero((distance >= 1) & level)[0]
            if len(starts):
                tasks.append(Task(int(goal), starts + offset))
        return tasks

    @classmethod
    def load(cls, folder: Path, rooms: list[tuple[str, int]] | None = None) -> SceneBank:
        """Open the scenes below a folder, all of them or the named (type, seed) rooms.

        Raises:
            SceneError: none there, one named is missing, or one is damaged.
        """
        if rooms is None:
            paths = sorted(p.parent for p in folder.glob("*/scene.json"))
        else:
            paths = [folder / f"{kind}_{seed:05d}" for kind, seed in rooms]
        return cls([OfflineScene.load(p) for p in paths])

    def sample(self, rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Draw n episodes: start states int64 [n], goals int64 [n]; rooms and goals uniform."""
        chosen = [self.tasks[k] for k in rng.integers(len(self.tasks), size=n)]
        states = np.array([t.starts[rng.integers(len(t.starts))] for t in chosen])
        return states, np.array([t.goal for t in chosen])


@dataclass(frozen=True)
class StepResult:
    """What one step did, all [B].

    Attributes:
        success: bool, Done with the goal visible.
        collided: bool, MoveAhead without an edge.
        terminated: bool, Done was chosen.
        truncated: bool, the step limit ended the episode.
    """

    success: Tensor
    collided: Tensor
    terminated: Tensor
    truncated: Tensor


class ObjectNavEnv:
    """B parallel episodes that restart by themselves.

    Args:
        bank: the scenes.
        batch: B.
        rng: source of all randomness.
    """

    def __init__(self, bank: SceneBank, batch: int, rng: np.random.Generator) -> None:
        self.bank, self.batch, self.rng = bank, batch, rng
        as_tensor = torch.from_numpy
        self._features = as_tensor(np.ascontiguousarray(bank.features))
        self._detections = as_tensor(np.ascontiguousarray(bank.detections))
        self._next, self._visible = as_tensor(bank.next_state), as_tensor(bank.visible)
        self._collided, self._limit = as_tensor(bank.collided), as_tensor(bank.step_limit)
        states, goals = bank.sample(rng, batch)
        self.state, self.goal = as_tensor(states), as_tensor(goals)
        self.steps = torch.zeros(batch, dtype=torch.int64)
        self.collisions = torch.zeros(batch, dtype=torch.int64)

    def observe(self) -> tuple[Tensor, Tensor]:
        """Features float32 [B, F] and detections float32 [B, C, 5] of the present states."""
        return self._features[self.state].float(), self._detections[self.state].float()

    def step(self, action: Tensor) -> StepResult:
        """Act. ``restart`` must be called with the episodes that ended before the next step.

        Args:
            action: int64 [B].
        """
        done = action == Action.Done
        success = done & self._visible[self.state, self.goal]
        collided = (action == Action.MoveAhead) & self._collided[self.state]
        self.steps += 1
        self.collisions += collided
        truncated = (self.steps >= self._limit[self.state]) & ~done
        self.state = self._next[self.state, action]
        return StepResult(success, collided, done, truncated)

    def restart(self, ended: Tensor) -> None:
        """Begin new episodes where ``ended`` (bool [B])."""
        index = ended.nonzero().squeeze(1)
        if len(index):
            states, goals = self.bank.sample(self.rng, len(index))
            self.state = self.state.index_copy(0, index, torch.from_numpy(states))
            self.goal = self.goal.index_copy(0, index, torch.from_numpy(goals))
            self.steps = self.steps.index_fill(0, index, 0)
            self.collisions = self.collisions.index_fill(0, index, 0)
