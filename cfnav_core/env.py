"""``ObjectNavEnv``: many object-goal episodes at once over offline scenes.

Observation of each episode: the perception's features and detections of its state, and the goal.
Actions: ``actions.Action``. MoveAhead without an edge leaves the state as it is and is a
collision. Done ends the episode, with success when the goal is visible; so does the step limit
(``truncated``). Collisions do not end an episode. Randomness enters through the given generator.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from cfnav_core.actions import Action
from cfnav_core.models import Inputs
from cfnav_core.reward import StepFacts
from cfnav_core.scene import OfflineScene, SceneError
from cfnav_core.scenes import open_scenes
from cfnav_core.vocabulary import ROOM_TYPES

STEP_LIMIT = 100
LIVING_ROOM_STEP_LIMIT = 200
IN_MEMORY_BYTES = 2 << 30
"""Features and detections up to this size are joined in memory."""


def step_limit(room_type: str) -> int:
    """Most actions of an episode, Done included: the lineage's 100, 200 in living rooms."""
    return LIVING_ROOM_STEP_LIMIT if room_type == "living_room" else STEP_LIMIT


@dataclass(frozen=True)
class Tasks:
    """What can be asked for: K goals, each in one scene.

    Attributes:
        scene, goal: int64 [K], row of the bank's scenes, and object.
        first, count: int64 [K], where its possible starts lie in ``starts``.
        starts: int64 [N], level states from which the goal can be reached but is not seen yet.
    """

    scene: np.ndarray
    goal: np.ndarray
    first: np.ndarray
    count: np.ndarray
    starts: np.ndarray


class Blocks:
    """Rows of equal shape in one or many arrays, read by row number.

    Small arrays are joined in memory; large ones stay mapped from disk, so that what is resident
    is bounded by the rows in use.

    Args:
        arrays: float16 [n_k, ...] each.
        in_memory: whether small ones may be joined.
    """

    def __init__(self, arrays: list[np.ndarray], in_memory: bool = True) -> None:
        if in_memory and sum(a.nbytes for a in arrays) <= IN_MEMORY_BYTES:
            arrays = [np.concatenate(arrays)]
        self._blocks = [torch.from_numpy(a) for a in arrays]
        self._first = torch.tensor(np.cumsum([0, *(len(a) for a in arrays)])[:-1])

    def __getitem__(self, rows: Tensor) -> Tensor:
        """Float32 [..., *shape] of rows int64 [...]."""
        if len(self._blocks) == 1:
            return self._blocks[0][rows].float()
        flat = rows.flatten()
        block = torch.searchsorted(self._first, flat, right=True) - 1
        out = torch.empty(len(flat), *self._blocks[0].shape[1:])
        for k in block.unique().tolist():
            at = (block == k).nonzero()[:, 0]
            out[at] = self._blocks[k][flat[at] - self._first[k]].float()
        return out.unflatten(0, rows.shape)


class SceneBank:
    """Scenes joined into one table of states.

    Args:
        scenes: at least one, all made with the same perception for the same objects.
        in_memory: see ``Blocks``.

    Raises:
        SceneError: no scenes, mixed perceptions or objects, or no goal that can be reached.
    """

    def __init__(self, scenes: list[OfflineScene], in_memory: bool = True) -> None:
        if not scenes:
            raise SceneError("found no scenes; make some with python -m sim_bridge.dataset")
        made_with = {(s.perception, s.objects) for s in scenes}
        if len(made_with) > 1:
            identities = sorted({p for p, _ in made_with})
            raise SceneError(
                f"found scenes of {len(made_with)} kinds (perceptions {', '.join(identities)}); "
                "make all of them with the same perception for the same objects"
            )
        self.scenes = scenes
        self.perception, self.objects = scenes[0].perception, scenes[0].objects
        self.names = [s.name for s in scenes]
        sizes = [s.num_states for s in scenes]
        self.offsets = np.cumsum([0, *sizes])
        self.scene = np.repeat(np.arange(len(scenes)), sizes)
        self.room = np.array([ROOM_TYPES.index(s.room_type) for s in scenes])[self.scene]
        self.step_limit = np.array([step_limit(s.room_type) for s in scenes])[self.scene]
        self.next_state = np.concatenate(
            [np.asarray(s.next_state, np.int64) + o for s, o in self._with_offsets()]
        )
        self.collided = np.concatenate([s.collided for s in scenes])
        self.visible = np.concatenate([s.visible for s in scenes])
        places = np.cumsum([0, *(len(s.positions) for s in scenes)])
        self.place = torch.from_numpy(
            np.concatenate([s.position + p for s, p in zip(scenes, places, strict=False)])
        )
        self.distance = torch.from_numpy(np.concatenate([s.distance for s in scenes]))
        self.actions_to = np.full((self.offsets[-1], len(self.objects)), -1, np.int16)
        self.tasks = self._find_tasks()
        self._features = Blocks([s.features for s in scenes], in_memory)
        self._detections = Blocks([s.detections for s in scenes], in_memory)

    def _with_offsets(self) -> zip[tuple[OfflineScene, int]]:
        return zip(self.scenes, self.offsets[:-1].tolist(), strict=True)

    def _find_tasks(self) -> Tasks:
        scene, goals, starts = [], [], []
        for k, (s, offset) in enumerate(self._with_offsets()):
            for name in s.goals:
                goal = self.objects.index(name)
                distance = s.actions_to(goal)
                self.actions_to[offset : offset + s.num_states, goal] = distance
                found = np.nonzero((distance >= 1) & (s.horizon == 0))[0]
                if len(found):
                    scene.append(k)
                    goals.append(goal)
                    starts.append(found + offset)
        if not starts:
            raise SceneError(f"found no goal that can be reached in {', '.join(self.names)}")
        count = np.array([len(x) for x in starts])
        first = np.cumsum([0, *count])[:-1]
        return Tasks(np.array(scene), np.array(goals), first, count, np.concatenate(starts))

    @classmethod
    def load(cls, folder: Path, rooms: Sequence[str] = (), in_memory: bool = True) -> SceneBank:
        """Open scenes of a folder or a store, see ``scenes.open_scenes``.

        Raises:
            SceneError: none there, one named is missing, or one is damaged.
            ValueError: rooms that cannot be read.
        """
        return cls(open_scenes(folder, rooms), in_memory)

    @property
    def inputs(self) -> Inputs:
        """What these scenes offer to a model."""
        first = self.scenes[0]
        return Inputs(first.features.shape[1:], first.detections.shape[2], self.objects)

    def observe(self, state: Tensor) -> tuple[Tensor, Tensor]:
        """Features float32 [..., *F] and detections float32 [..., C, D] of states int64 [...]."""
        return self._features[state], self._detections[state]

    @cached_property
    def paths(self) -> Tensor:
        """float32 [S, C]: shortest driven way (m) from each state to see an object; inf never."""
        out = torch.full((len(self.scene), len(self.objects)), torch.inf)
        for k, goal in zip(self.tasks.scene, self.tasks.goal, strict=True):
            states = slice(self.offsets[k], self.offsets[k + 1])
            metres = self.scenes[k].metres_to(goal)[self.scenes[k].position]
            out[states, goal] = torch.from_numpy(metres).float()
        return out

    def sample(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Draw n episodes: start states int64 [n], goals int64 [n]; tasks, then starts, uniform.

        Args:
            u: float64 [n, 2], uniform in [0, 1).
        """
        k = (u[:, 0] * len(self.tasks.goal)).astype(np.int64)
        start = self.tasks.first[k] + (u[:, 1] * self.tasks.count[k]).astype(np.int64)
        return self.tasks.starts[start], self.tasks.goal[k]


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


@dataclass(frozen=True)
class Part:
    """The episodes first..first+batch of ``of`` that run at once, on all ranks together.

    Randomness is drawn for all of them and everybody takes their own, so that an episode is the
    same whoever runs it.
    """

    first: int
    batch: int
    of: int

    def rows(self, all_rows: np.ndarray) -> np.ndarray:
        """One's own of what was drawn for all."""
        return all_rows[self.first : self.first + self.batch]


class ObjectNavEnv:
    """B parallel episodes that restart by themselves.

    Args:
        bank: the scenes.
        batch: B, or one's part of all episodes.
        rng: source of all randomness, the same for everybody who runs a part.
    """

    def __init__(self, bank: SceneBank, batch: int | Part, rng: np.random.Generator) -> None:
        self.bank, self.rng = bank, rng
        self.part = batch if isinstance(batch, Part) else Part(0, batch, batch)
        self.batch = self.part.batch
        as_tensor = torch.from_numpy
        self._room = as_tensor(bank.room)
        self._next, self._visible = as_tensor(bank.next_state), as_tensor(bank.visible)
        self._collided, self._limit = as_tensor(bank.collided), as_tensor(bank.step_limit)
        states, goals = bank.sample(self._draw())
        self.state, self.goal = as_tensor(states), as_tensor(goals)
        self.steps = torch.zeros(self.batch, dtype=torch.int64)
        self.collisions = torch.zeros(self.batch, dtype=torch.int64)

    def _draw(self) -> np.ndarray:
        return self.part.rows(self.rng.random((self.part.of, 2)))

    def observe(self) -> tuple[Tensor, Tensor]:
        """``SceneBank.observe`` of the present states."""
        return self.bank.observe(self.state)

    @property
    def goal_one_hot(self) -> Tensor:
        """float32 [B, C]."""
        return F.one_hot(self.goal, len(self.bank.objects)).float()

    @property
    def room_one_hot(self) -> Tensor:
        """float32 [B, 4], the room type."""
        return F.one_hot(self._room[self.state], len(ROOM_TYPES)).float()

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

    def facts(
        self, before: Tensor, action: Tensor, success: Tensor, paths: bool = False
    ) -> StepFacts:
        """What rewards may ask about the last step.

        Args:
            before: int64 [B], the states it began in.
            action: int64 [B].
            success: bool [B].
            paths: also look up shortest paths, which takes seconds to prepare; 0 otherwise.
        """
        bank, goal, now = self.bank, self.goal, self.state
        none = torch.zeros(self.batch)
        return StepFacts(
            action, success, goal, self._room[now],
            bank.distance[bank.place[before], goal], bank.distance[bank.place[now], goal],
            bank.paths[before, goal] if paths else none,
            bank.paths[now, goal] if paths else none, self._visible[now],
        )  # fmt: skip

    def restart(self, ended: Tensor) -> None:
        """Begin new episodes where ``ended`` (bool [B]); to be called after every step."""
        u, index = self._draw(), ended.nonzero().squeeze(1)
        if len(index):
            states, goals = self.bank.sample(u[ended.numpy()])
            self.state = self.state.index_copy(0, index, torch.from_numpy(states))
            self.goal = self.goal.index_copy(0, index, torch.from_numpy(goals))
            self.steps = self.steps.index_fill(0, index, 0)
            self.collisions = self.collisions.index_fill(0, index, 0)
