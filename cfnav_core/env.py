"""``ObjectNavEnv``: many object-goal episodes at once over offline scenes.

Observation of each episode: the perception's features and detections of its state, and the goal.
Actions: ``actions.Action``. MoveAhead without an edge leaves the state as it is and is a
collision. Done ends the episode, with success when the goal is visible; so does the step limit
(``truncated``). Collisions do not end an episode. Randomness enters through the given generator.
"""

from __future__ import annotations

import mmap
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
from torch import Tensor

from cfnav_core.actions import Action
from cfnav_core.models import Inputs
from cfnav_core.published.draw import chances
from cfnav_core.published.layouts import Layout
from cfnav_core.reward import StepFacts
from cfnav_core.scene import OfflineScene, SceneError
from cfnav_core.scenes import layout_of, open_scenes
from cfnav_core.vocabulary import ROOM_TYPES

CPU = torch.device("cpu")
STEP_LIMIT = 100
LIVING_ROOM_STEP_LIMIT = 200
IN_MEMORY_BYTES = 2 << 30
"""Features and detections up to this size each are joined in main memory."""


def step_limit(room_type: str) -> int:
    """Most actions of an episode, Done included: 100, 200 in living rooms, as the lineage tests."""
    return LIVING_ROOM_STEP_LIMIT if room_type == "living_room" else STEP_LIMIT


@dataclass(frozen=True)
class Tasks:
    """What can be asked for: K goals, each in one scene.

    Attributes:
        scene, goal: int64 [K], row of the bank's scenes, and object.
        first, count: int64 [K], where its possible starts lie in ``starts``.
        starts: int64 [N], level states from which the goal can be reached; of built-in rooms only
            those that do not see it yet.
        upto: float64 [K], running sum of the tasks' probabilities; None where all are alike.
    """

    scene: np.ndarray
    goal: np.ndarray
    first: np.ndarray
    count: np.ndarray
    starts: np.ndarray
    upto: np.ndarray | None


class Blocks:
    """Rows of equal shape in one or many arrays, read by row number.

    What fits is joined in the memory of the device, at most half of a GPU's. Larger data stay
    mapped from disk: a row in use is read from there, and the process itself holds nothing of it;
    the system keeps read pages as long as it has memory to spare.

    Args:
        arrays: float16 [n_k, ...] each.
        device: where rows are wanted.
        in_memory: whether they may be joined.
    """

    def __init__(
        self, arrays: list[np.ndarray], device: torch.device, in_memory: bool = True
    ) -> None:
        self.device = device
        most = IN_MEMORY_BYTES
        if device.type == "cuda":
            most = torch.cuda.mem_get_info(device)[0] // 2
        self._joined = in_memory and sum(a.nbytes for a in arrays) <= most
        self._blocks = [torch.from_numpy(a) for a in arrays]
        ends = np.cumsum([len(a) for a in arrays])
        self._first = torch.from_numpy(np.append(0, ends[:-1]))
        if self._joined:
            self._blocks = [self._join(int(ends[-1]))]
        else:
            for array in arrays:
                _read_only_what_is_asked_for(array)

    def _join(self, rows: int) -> Tensor:
        shape, kind = (rows, *self._blocks[0].shape[1:]), self._blocks[0].dtype
        # 1x1 convolutions read the channels of a place; the values stay the same
        order = torch.channels_last if len(shape) == 4 else torch.contiguous_format
        whole = torch.empty(shape, dtype=kind, device=self.device, memory_format=order)
        for first, block in zip(self._first.tolist(), self._blocks, strict=True):
            whole[first : first + len(block)] = block.to(self.device)
        return whole

    def __getitem__(self, rows: Tensor) -> Tensor:
        """Float32 [..., *shape] on the device, of rows int64 [...]."""
        if self._joined:
            return self._blocks[0][rows.to(self.device)].float()
        flat = rows.flatten().cpu()
        block = torch.searchsorted(self._first, flat, right=True) - 1
        out = torch.empty(len(flat), *self._blocks[0].shape[1:], device="cpu")
        for k in block.unique().tolist():
            at = (block == k).nonzero()[:, 0]
            out[at] = self._blocks[k][flat[at] - self._first[k]].float()
        return out.unflatten(0, rows.shape).to(self.device)


def _read_only_what_is_asked_for(array: np.ndarray) -> None:
    """Tell the system not to read ahead in a mapped file: rows are drawn at random."""
    base: Any = array
    while isinstance(base, np.ndarray):
        base = base.base
    if isinstance(base, mmap.mmap):
        base.madvise(mmap.MADV_RANDOM)


class SceneBank:
    """Scenes joined into one table of states.

    Args:
        scenes: at least one, all made with the same perception for the same objects.
        layout: published data set whose rule draws the episodes (see ``published.draw``); without
            one, tasks and then starts are drawn alike.
        device: where observations and tables are wanted.
        in_memory: see ``Blocks``.

    Raises:
        SceneError: no scenes, mixed perceptions or objects, or a scene without a goal that can be
            reached.
    """

    def __init__(
        self,
        scenes: list[OfflineScene],
        *,
        layout: Layout | None = None,
        device: torch.device = CPU,
        in_memory: bool = True,
    ) -> None:
        if not scenes:
            raise SceneError("found no scenes; make some with python -m sim_bridge.dataset")
        made_with = {(s.perception, s.objects) for s in scenes}
        if len(made_with) > 1:
            identities = sorted({p for p, _ in made_with})
            raise SceneError(
                f"found scenes of {len(made_with)} kinds (perceptions {', '.join(identities)}); "
                "make all of them with the same perception for the same objects"
            )
        self.scenes, self.device = scenes, device
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
        ).to(device)
        self.distance = torch.from_numpy(np.concatenate([s.distance for s in scenes])).to(device)
        self.actions_to = np.full((self.offsets[-1], len(self.objects)), -1, np.int16)
        self.tasks = self._find_tasks(layout)
        self._features = Blocks([s.features for s in scenes], device, in_memory)
        self._detections = Blocks([s.detections for s in scenes], device, in_memory)

    def _with_offsets(self) -> zip[tuple[OfflineScene, int]]:
        return zip(self.scenes, self.offsets[:-1].tolist(), strict=True)

    def _find_tasks(self, layout: Layout | None) -> Tasks:
        scene, goals, starts = [], [], []
        nearest = 0 if layout else 1
        for k, (s, offset) in enumerate(self._with_offsets()):
            for name in s.goals:
                goal = self.objects.index(name)
                distance = s.actions_to(goal)
                self.actions_to[offset : offset + s.num_states, goal] = distance
                found = np.nonzero((distance >= nearest) & (s.horizon == 0))[0]
                if len(found):
                    scene.append(k)
                    goals.append(goal)
                    starts.append(found + offset)
        if idle := [name for k, name in enumerate(self.names) if k not in scene]:
            raise SceneError(
                f"found no goal that can be reached in {', '.join(idle)}, so no episode; leave "
                "that scene out, or mend it (cfnav data check)"
            )
        count = np.array([len(x) for x in starts])
        first = np.cumsum([0, *count])[:-1]
        upto = None
        if layout:
            instances = [self.scenes[k].instances[g] for k, g in zip(scene, goals, strict=True)]
            room = self.room[self.offsets[scene]]
            upto = np.cumsum(chances(layout, np.array(scene), room, np.array(instances)))
            upto /= upto[-1]
        return Tasks(np.array(scene), np.array(goals), first, count, np.concatenate(starts), upto)

    @classmethod
    def load(
        cls,
        folder: Path,
        rooms: Sequence[str] = (),
        device: torch.device = CPU,
        in_memory: bool = True,
    ) -> SceneBank:
        """Open scenes of a folder or a store, see ``scenes.open_scenes``.

        A store of published data draws as its code does.

        Raises:
            SceneError: none there, one named is missing, or one is damaged.
            ValueError: rooms that cannot be read.
        """
        scenes = open_scenes(folder, rooms)
        return cls(scenes, layout=layout_of(folder), device=device, in_memory=in_memory)

    @property
    def inputs(self) -> Inputs:
        """What these scenes offer to a model."""
        first = self.scenes[0]
        return Inputs(first.features.shape[1:], first.detections.shape[2], self.objects)

    def observe(self, state: Tensor) -> tuple[Tensor, Tensor]:
        """Features float32 [..., *F] and detections float32 [..., C, D] of states int64 [...].

        They lie on the bank's device.
        """
        return self._features[state], self._detections[state]

    @cached_property
    def paths(self) -> Tensor:
        """float32 [S, C]: shortest driven way (m) from each state to see an object; inf never."""
        out = torch.full((len(self.scene), len(self.objects)), torch.inf, device=CPU)
        for k, goal in zip(self.tasks.scene, self.tasks.goal, strict=True):
            states = slice(self.offsets[k], self.offsets[k + 1])
            metres = self.scenes[k].metres_to(goal)[self.scenes[k].position]
            out[states, goal] = torch.from_numpy(metres).float()
        return out.to(self.device)

    def sample(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Draw n episodes: start states int64 [n], goals int64 [n]; starts of a task uniform.

        Args:
            u: float64 [n, 2], uniform in [0, 1).
        """
        if self.tasks.upto is None:
            k = (u[:, 0] * len(self.tasks.goal)).astype(np.int64)
        else:
            k = np.searchsorted(self.tasks.upto, u[:, 0], side="right")
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


Rows = TypeVar("Rows", np.ndarray, Tensor)


@dataclass(frozen=True)
class Part:
    """The episodes first..first+batch of ``of`` that run at once, on all ranks together.

    Randomness is drawn for all of them and everybody takes their own, so that an episode is the
    same whoever runs it.
    """

    first: int
    batch: int
    of: int

    def rows(self, all_rows: Rows) -> Rows:
        """One's own of what was drawn for all."""
        return all_rows[self.first : self.first + self.batch]


class ObjectNavEnv:
    """B parallel episodes that restart by themselves.

    Args:
        bank: the scenes; the environment lives on its device.
        batch: B, or one's part of all episodes.
        rng: source of all randomness, the same for everybody who runs a part.
        most_steps: of an episode, where fewer than at test; 0: as many as there.
    """

    def __init__(
        self, bank: SceneBank, batch: int | Part, rng: np.random.Generator, most_steps: int = 0
    ) -> None:
        self.bank, self.rng = bank, rng
        self.part = batch if isinstance(batch, Part) else Part(0, batch, batch)
        self.batch, self.device = self.part.batch, bank.device
        # rows of these are one-hot, without the checks of a general function at every step
        self._goals = torch.eye(len(bank.objects), device=self.device)
        self._rooms = torch.eye(len(ROOM_TYPES), device=self.device)
        self._room = self._tensor(bank.room)
        self._next, self._visible = self._tensor(bank.next_state), self._tensor(bank.visible)
        self._collided, self._limit = self._tensor(bank.collided), self._tensor(bank.step_limit)
        if most_steps:
            self._limit = self._limit.clamp(max=most_steps)
        states, goals = bank.sample(self._draw())
        self.state, self.goal = self._tensor(states), self._tensor(goals)
        self.steps = torch.zeros(self.batch, dtype=torch.int64, device=self.device)
        self.collisions = torch.zeros_like(self.steps)

    def _tensor(self, array: np.ndarray) -> Tensor:
        return torch.from_numpy(array).to(self.device)

    def _draw(self) -> np.ndarray:
        return self.part.rows(self.rng.random((self.part.of, 2)))

    def observe(self) -> tuple[Tensor, Tensor]:
        """``SceneBank.observe`` of the present states."""
        return self.bank.observe(self.state)

    @property
    def goal_one_hot(self) -> Tensor:
        """float32 [B, C]."""
        return self._goals[self.goal]

    @property
    def room_one_hot(self) -> Tensor:
        """float32 [B, 4], the room type."""
        return self._rooms[self._room[self.state]]

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

    @property
    def blocked(self) -> Tensor:
        """Whether MoveAhead would collide now: bool [B]."""
        return self._collided[self.state]

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
        none = torch.zeros(self.batch, device=self.device)
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
            states, goals = self.bank.sample(u[ended.cpu().numpy()])
            self.state = self.state.index_copy(0, index, self._tensor(states))
            self.goal = self.goal.index_copy(0, index, self._tensor(goals))
            self.steps = self.steps.index_fill(0, index, 0)
            self.collisions = self.collisions.index_fill(0, index, 0)
