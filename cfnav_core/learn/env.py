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
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor

from cfnav_core.agent.reward import StepFacts
from cfnav_core.learn.blocks import Blocks
from cfnav_core.models.base import ObservationSpec
from cfnav_core.scenes.draw import Law
from cfnav_core.scenes.scene import OfflineScene, SceneError
from cfnav_core.scenes.select import camera_of, law_of, open_scenes, without
from cfnav_core.task.actions import Action
from cfnav_core.task.limits import step_limit
from cfnav_core.task.vocabulary import ROOM_TYPES

CPU = torch.device("cpu")


@dataclass(frozen=True)
class Tasks:
    """What can be asked for: K goals, each in one scene.

    Attributes:
        scene, goal: int64 [K], row of the bank's scenes, and object.
        first, count: int64 [K], where its possible starts lie in ``starts``.
        starts: int64 [N], level states from which the goal can be reached.
        upto: float64 [K], running sum of the tasks' probabilities; None where all are alike.
    """

    scene: np.ndarray
    goal: np.ndarray
    first: np.ndarray
    count: np.ndarray
    starts: np.ndarray
    upto: np.ndarray | None


@dataclass(frozen=True)
class Tables:
    """What a step looks up by the state, on a device.

    Attributes:
        next_state: int64 [S, 6]. collided: bool [S], a MoveAhead would. visible: bool [S, C].
        room: int64 [S], row of ``ROOM_TYPES``. step_limit: int64 [S].
    """

    next_state: Tensor
    collided: Tensor
    visible: Tensor
    room: Tensor
    step_limit: Tensor


class SceneBank:
    """Scenes joined into one table of states.

    Args:
        scenes: at least one, all made with the same perception for the same objects.
        law: probability of each task, whose starts are then all level states; without one tasks
            are drawn alike, and starts do not see the goal yet.
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
        law: Law | None = None,
        device: torch.device = CPU,
        in_memory: bool = True,
    ) -> None:
        if not scenes:
            raise SceneError("found no scenes; make some with cfnav rooms make")
        made_with = {(s.perception, s.objects) for s in scenes}
        if len(made_with) > 1:
            identities = sorted({p for p, _ in made_with})
            raise SceneError(
                f"found scenes of {len(made_with)} kinds (perceptions {', '.join(identities)}); "
                "make all of them with the same perception for the same objects"
            )
        self.scenes, self.device = scenes, device
        self.perception, self.objects = scenes[0].perception, scenes[0].objects
        self.camera = camera_of(scenes)
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
        self.tasks = self._find_tasks(law)
        self._features = Blocks([s.features for s in scenes], device, in_memory)
        self._detections = Blocks([s.detections for s in scenes], device, in_memory)

    def _with_offsets(self) -> zip[tuple[OfflineScene, int]]:
        return zip(self.scenes, self.offsets[:-1].tolist(), strict=True)

    def _find_tasks(self, law: Law | None) -> Tasks:
        scene, goals, starts = [], [], []
        nearest = 0 if law else 1
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
        if law:
            instances = [self.scenes[k].instances[g] for k, g in zip(scene, goals, strict=True)]
            room = self.room[self.offsets[scene]]
            upto = np.cumsum(law(np.array(scene), room, np.array(instances)))
            upto /= upto[-1]
        return Tasks(np.array(scene), np.array(goals), first, count, np.concatenate(starts), upto)

    @classmethod
    def load(
        cls,
        folder: Path,
        rooms: Sequence[str] = (),
        device: torch.device = CPU,
        in_memory: bool = True,
        leave_out: Sequence[str] = (),
    ) -> SceneBank:
        """Open scenes of a folder or a store, see ``scenes.select.open_scenes``.

        A store of published data draws as its code does. Goals to leave out are neither asked for
        nor detected, and scenes that have no other are not there.

        Raises:
            SceneError: none there, one named is missing, or one is damaged.
            ValueError: rooms that cannot be read, or goals to leave out that nobody knows.
        """
        scenes = open_scenes(folder, rooms)
        if leave_out:
            scenes = without(scenes, leave_out)
        return cls(scenes, law=law_of(folder), device=device, in_memory=in_memory)

    @property
    def inputs(self) -> ObservationSpec:
        """What these scenes offer to a model."""
        first = self.scenes[0]
        return ObservationSpec(first.features.shape[1:], first.fields, self.objects)

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

    @cached_property
    def tables(self) -> Tables:
        """The same tables on the bank's device."""
        arrays = (self.next_state, self.collided, self.visible, self.room, self.step_limit)
        return Tables(*(torch.from_numpy(a).to(self.device) for a in arrays))

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
    """What one step did, all bool [B].

    Attributes:
        success: Done with the goal visible.
        collided: MoveAhead without an edge.
        terminated: Done was chosen.
        truncated: the step limit ended the episode.
    """

    success: Tensor
    collided: Tensor
    terminated: Tensor
    truncated: Tensor

    @property
    def ended(self) -> Tensor:
        """Terminated or truncated."""
        return self.terminated | self.truncated


class Walk:
    """Episodes that are walked side by side until they end.

    Attributes:
        state, goal: int64 [B]. steps, collisions: int64 [B], of the episode so far.

    Args:
        bank: the scenes; all tensors lie on its device.
        states, goals: int64 [B], where each begins and what it looks for.
        most_steps: of an episode, where fewer than at test; 0: as many as there.
    """

    def __init__(
        self, bank: SceneBank, states: np.ndarray, goals: np.ndarray, most_steps: int = 0
    ) -> None:
        self.bank, self.device = bank, bank.device
        self.state, self.goal = self._tensor(states), self._tensor(goals)
        self.steps = torch.zeros_like(self.state)
        self.collisions = torch.zeros_like(self.state)
        self._limit = bank.tables.step_limit
        if most_steps:
            self._limit = self._limit.clamp(max=most_steps)
        # rows of these are one-hot, without the checks of a general function at every step
        self._goals = torch.eye(len(bank.objects), device=self.device)
        self._rooms = torch.eye(len(ROOM_TYPES), device=self.device)

    def _tensor(self, array: np.ndarray) -> Tensor:
        return torch.from_numpy(array).to(self.device)

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
        return self._rooms[self.bank.tables.room[self.state]]

    @property
    def blocked(self) -> Tensor:
        """Whether MoveAhead would collide now: bool [B]."""
        return self.bank.tables.collided[self.state]

    def step(self, action: Tensor, veto: Tensor | None = None) -> StepResult:
        """Act. Episodes that end go no further: leave them behind, or begin new ones.

        Args:
            action: int64 [B].
            veto: bool [B], where a MoveAhead is not carried out; a step it is all the same.
        """
        tables, at = self.bank.tables, self.state
        done, collides = action == Action.Done, (action == Action.MoveAhead) & tables.collided[at]
        success = done & tables.visible[at, self.goal]
        reached = tables.next_state[at, action]
        if veto is not None:
            forbidden = veto & (action == Action.MoveAhead)
            collides, reached = collides & ~forbidden, torch.where(forbidden, at, reached)
        self.steps += 1
        self.collisions += collides
        self.state = reached
        return StepResult(success, collides, done, (self.steps >= self._limit[at]) & ~done)

    def leave(self, ended: Tensor) -> None:
        """Go on with the episodes that did not end (bool [B])."""
        going = ~ended
        self.state, self.goal = self.state[going], self.goal[going]
        self.steps, self.collisions = self.steps[going], self.collisions[going]


Rows = TypeVar("Rows", np.ndarray, Tensor)


@dataclass(frozen=True)
class EpisodeSlice:
    """The episodes first..first+batch of ``total`` that run at once, on all ranks together.

    Randomness is drawn for all of them and everybody takes their own, so that an episode is the
    same whoever runs it.
    """

    first: int
    batch: int
    total: int

    def rows(self, all_rows: Rows) -> Rows:
        """One's own of what was drawn for all."""
        return all_rows[self.first : self.first + self.batch]


class ObjectNavEnv(Walk):
    """B parallel episodes that restart by themselves.

    ``restart`` must be called after every step with the episodes that ended.

    Args:
        bank: the scenes; the environment lives on its device.
        batch: B, or one's part of all episodes.
        rng: source of all randomness, the same for everybody who runs a part.
        most_steps: see ``Walk``.
    """

    def __init__(
        self,
        bank: SceneBank,
        batch: int | EpisodeSlice,
        rng: np.random.Generator,
        most_steps: int = 0,
    ) -> None:
        self.rng = rng
        self.part = batch if isinstance(batch, EpisodeSlice) else EpisodeSlice(0, batch, batch)
        self.batch = self.part.batch
        super().__init__(bank, *bank.sample(self._draw()), most_steps)

    def _draw(self) -> np.ndarray:
        return self.part.rows(self.rng.random((self.part.total, 2)))

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
            action, success, goal, bank.tables.room[now],
            bank.distance[bank.place[before], goal], bank.distance[bank.place[now], goal],
            bank.paths[before, goal] if paths else none,
            bank.paths[now, goal] if paths else none, bank.tables.visible[now],
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
