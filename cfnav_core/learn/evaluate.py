"""Frozen episodes over offline scenes, and the figures of a policy on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from cfnav_core.learn.candidate import Candidate, check_fits
from cfnav_core.learn.env import SceneBank, Walk
from cfnav_core.policy.networks import (
    Networks,
    Observation,
    sampled,
)
from cfnav_core.published.keys import Key, state_of
from cfnav_core.published.start_states import StartState, identity, read_episodes
from cfnav_core.scenes.scene import SceneError
from cfnav_core.scenes.select import lidar_of
from cfnav_core.task.actions import NUM_ACTIONS, Action
from cfnav_core.task.intervals import ends_text
from cfnav_core.task.limits import VETO_PROBABILITY
from cfnav_core.task.metrics import EpisodeResult, figures, paired
from cfnav_core.task.p_hat import SOURCES, TESTED, Known, PHat, check_kind, make_p_hat, needs_lidar
from cfnav_core.task.vocabulary import ROOM_TYPES

LONG_EPISODE = 5
"""Fewest actions (Done included) of the "length 5 or more" subset of the lineage."""


@dataclass(frozen=True)
class Episodes:
    """Starts and goals, in the order of ``SceneBank``.

    Attributes:
        states: int64 [N]. goals: int64 [N].
    """

    states: np.ndarray
    goals: np.ndarray

    @classmethod
    def draw(cls, bank: SceneBank, count: int, seed: int) -> Episodes:
        """Draw episodes as ``bank.sample`` does, from a seed alone."""
        return cls(*bank.sample(np.random.default_rng(seed).random((count, 2))))

    @classmethod
    def thaw(cls, bank: SceneBank, starts: Sequence[StartState]) -> Episodes:
        """Find frozen episodes in scenes.

        Raises:
            SceneError: a scene, state or goal is not there, or in built-in scenes no success is
                possible; published ones count such as failures, as their code does.
        """
        rows = {name: k for k, name in enumerate(bank.names)}
        states, goals = [], []
        for start in starts:
            if start.scene not in rows:
                raise SceneError(
                    f"found an episode in {start.scene}, but only scenes {', '.join(bank.names)}; "
                    "name all its scenes with --rooms, or none"
                )
            if start.goal not in bank.objects:
                raise SceneError(
                    f"found goal {start.goal!r}, which is none of these scenes' objects"
                )
            k = rows[start.scene]
            states.append(int(bank.offsets[k]) + state_of(bank.scenes[k], start.state))
            goals.append(bank.objects.index(start.goal))
        found = cls(np.array(states, np.int64), np.array(goals, np.int64))
        hopeless = np.flatnonzero(bank.actions_to[found.states, found.goals] < 0)
        if len(hopeless) and bank.tasks.upto is None:
            first = starts[hopeless[0]]
            raise SceneError(
                f"found {len(hopeless)} of {len(starts)} episodes that nobody can end, such as "
                f"{first.goal} in {first.scene}, where it is no goal or cannot be reached; give "
                "episodes of scenes like these (cfnav data freeze)"
            )
        return found

    def freeze(self, bank: SceneBank) -> list[StartState]:
        """Scene, state and goal of each as text, for a file."""
        starts = []
        for state, goal in zip(self.states, self.goals, strict=True):
            k = int(bank.scene[state])
            key = Key.of(bank.scenes[k], int(state - bank.offsets[k]))
            starts.append(StartState(bank.names[k], str(key), bank.objects[goal]))
        return starts

    def identity(self, bank: SceneBank) -> str:
        """First 16 hex digits of the hash that a file of these episodes carries."""
        return identity(self.freeze(bank))[:16]


@dataclass(frozen=True)
class Trace:
    """One step of the episodes that were still going.

    Attributes:
        episodes: int64 [N], which ones. states: int64 [N], where they were. actions: int64 [N].
        p_hat: float32 [N], what the policy was given.
    """

    episodes: np.ndarray
    states: np.ndarray
    actions: np.ndarray
    p_hat: np.ndarray


def run_episodes(
    networks: Networks, bank: SceneBank, episodes: Episodes, sample_seed: int | None = None,
    p_hat: PHat = "own", lidar: np.ndarray | None = None, veto: bool = False,
    trace: list[Trace] | None = None,
) -> list[EpisodeResult]:  # fmt: skip
    """Run all episodes side by side.

    Args:
        networks: torch or ONNX.
        bank: the scenes.
        episodes: starts and goals in them.
        sample_seed: draw actions with this seed; argmax when None.
        p_hat: what the policy is given; one of ``task.p_hat.TESTED``.
        lidar: float32 [S], what the LiDAR node says in every state; for p_hat "lidar" or
            "both", and for the veto. It is 1 where the episode met something before, as on the
            robot.
        veto: a MoveAhead that the LiDAR forbids is not carried out, as on the robot.
        trace: gets what happened at each step.

    Returns:
        Results with lengths in actions, Done included.
    """
    walk = Walk(bank, episodes.states, episodes.goals)
    n = len(episodes.states)
    memory, going = networks.zero_state(n), np.arange(n)
    success, steps, collisions = np.zeros(n, bool), np.zeros(n, int), np.zeros(n, int)
    rng = np.random.default_rng(0 if sample_seed is None else sample_seed)
    met = _Met(bank)
    while len(going):
        at, observation = walk.state.cpu().numpy(), _observation(walk)
        said = None if lidar is None else np.maximum(lidar[at], met.ahead(going, at))
        given = make_p_hat(p_hat, Known(
            zero=np.zeros(len(at), np.float32), own=partial(networks.predict, observation, memory),
            lidar=said, truth=bank.collided[at].astype(np.float32), mixed=rng.permutation,
        ))  # fmt: skip
        pi = networks.step(observation, memory, given)
        action = pi.argmax(1) if sample_seed is None else sampled(pi, rng)
        memory.previous_action = np.eye(NUM_ACTIONS, dtype=np.float32)[action]
        if trace is not None:
            trace.append(Trace(going, at, action, given))
        did = walk.step(_tensor(action, walk), _forbidden(said, walk) if veto else None)
        touched = did.collided.cpu().numpy()
        met.stop(going[touched], at[touched])
        ended = did.ended.cpu().numpy()
        success[going] = did.success.cpu().numpy()
        steps[going], collisions[going] = walk.steps.cpu().numpy(), walk.collisions.cpu().numpy()
        if ended.any():
            walk.leave(did.ended)
            memory, going = memory.rows(~ended), going[~ended]
    shortest = bank.actions_to[episodes.states, episodes.goals] + 1
    return [
        EpisodeResult(bool(s), int(c), float(d), float(best))
        for s, c, d, best in zip(success, collisions, steps, shortest, strict=True)
    ]


class _Met:
    """Where a MoveAhead of an episode met something: from there that way is not free.

    The robot's own memory of it is ``cfnav_ros.drive.track``.
    """

    def __init__(self, bank: SceneBank) -> None:
        heading = np.concatenate([scene.heading for scene in bank.scenes])
        self._way = bank.place.cpu().numpy() * (int(heading.max()) + 1) + heading
        self._ways = int(self._way.max()) + 1
        self._stops = np.empty(0, np.int64)

    def stop(self, episodes: np.ndarray, states: np.ndarray) -> None:
        """A MoveAhead of each episode, int [N], was stopped in its state."""
        self._stops = np.union1d(self._stops, self._key(episodes, states))

    def ahead(self, episodes: np.ndarray, states: np.ndarray) -> np.ndarray:
        """Float32 [N], 1 where one was stopped before in that place and heading, else 0."""
        return np.isin(self._key(episodes, states), self._stops).astype(np.float32)

    def _key(self, episodes: np.ndarray, states: np.ndarray) -> np.ndarray:
        return episodes * self._ways + self._way[states]


def _observation(walk: Walk) -> Observation:
    seen = (*walk.observe(), walk.goal_one_hot, walk.room_one_hot)
    return Observation(*(rows.cpu().numpy() for rows in seen))


def _tensor(rows: np.ndarray, walk: Walk) -> Tensor:
    return torch.from_numpy(rows).to(walk.device)


def _forbidden(lidar: np.ndarray | None, walk: Walk) -> Tensor:
    """Where the LiDAR, which says float32 [N], forbids a MoveAhead."""
    if lidar is None:
        raise ValueError("found a veto without what the LiDAR says; give lidar too")
    return _tensor(lidar >= VETO_PROBABILITY, walk)


@dataclass(frozen=True)
class Evaluation:
    """Results of one bundle or checkpoint on one set of frozen episodes.

    Attributes:
        what: path, model, method, seed, commit and training episodes of what was evaluated.
        goals: those that it was trained to find.
        trace: every step of the episodes.
    """

    what: dict[str, Any]
    goals: tuple[str, ...]
    bank: SceneBank
    episodes: Episodes
    results: list[EpisodeResult]
    trace: list[Trace]

    def __repr__(self) -> str:
        found = figures(self.results, self.rooms)
        ends, what = ends_text(found["cf_sr_interval"]), self.what
        return (
            f"<Evaluation of {what.get('bundle', what.get('checkpoint'))}: {len(self.results)} "
            f"episodes, SR {found['sr']:.3f}, CF-SR {found['cf_sr']:.3f} {ends}, "
            f"CF-SPL {found['cf_spl']:.3f}>"
        )

    @property
    def rooms(self) -> np.ndarray:
        """[N], the name of each episode's scene."""
        return np.array(self.bank.names)[self.bank.scene[self.episodes.states]]

    @property
    def trained(self) -> np.ndarray:
        """Bool [N], whether each episode's goal is one that it was trained to find."""
        return np.isin(self.bank.objects, self.goals)[self.episodes.goals]

    @property
    def wrong_done(self) -> float:
        """Share of the episodes that ended with a Done while the goal was not in view."""
        last = np.zeros(len(self.results), np.int64)
        for step in self.trace:
            last[step.episodes] = step.actions
        failed = ~np.array([result.success for result in self.results])
        return float(np.mean(failed & (last == Action.Done)))

    def summary(self) -> dict[str, Any]:
        """What was evaluated, and its figures: all, the long ones, by goal and by room type.

        Goals that it was trained to find and others apart; None where there are no such episodes.
        """
        rooms, trained = self.rooms, self.trained
        long = np.array([r.shortest_path_length >= LONG_EPISODE for r in self.results])
        by_goal = {
            self.bank.objects[g]: _cf_sr_of(self.results, self.episodes.goals == g)
            for g in np.unique(self.episodes.goals)
        }
        kinds = np.array(ROOM_TYPES)[self.bank.room[self.episodes.states]]
        return {
            **self.what,
            **figures(self.results, rooms),
            "wrong_done": self.wrong_done,
            "long": self._figures_of(long),
            "trained_goals": self._figures_of(trained), "other_goals": self._figures_of(~trained),
            "cf_sr_by_room_type": {
                k: _cf_sr_of(self.results, kinds == k) for k in np.unique(kinds)
            },
            "cf_sr_by_goal": by_goal,
            "episodes_identity": self.episodes.identity(self.bank),
            "scenes": self.bank.names,
        }  # fmt: skip

    def _figures_of(self, chosen: np.ndarray) -> dict[str, Any] | None:
        """Figures of the episodes that bool [N] chooses, None when it chooses none."""
        results = [self.results[i] for i in np.flatnonzero(chosen)]
        return figures(results, self.rooms[chosen]) if results else None


def _cf_sr_of(results: list[EpisodeResult], chosen: np.ndarray) -> dict[str, float]:
    values = [r.cf_success for r, c in zip(results, chosen, strict=True) if c]
    return {"cf_sr": round(float(np.mean(values)), 4), "episodes": len(values)}


def evaluate(
    path: Path, scenes: Path, episodes: int, seed: int, sample: bool = False,
    p_hat: str = "own", rooms: Sequence[str] = (), frozen: Path | None = None,
    veto: bool = False, most: int | None = None,
) -> Evaluation:  # fmt: skip
    """Run a bundle or a checkpoint on frozen episodes: of a file, or drawn from a seed.

    The first ``most`` of a file when there are more.

    Raises:
        BundleError: the bundle cannot be used.
        CheckpointError: the checkpoint cannot be used.
        SceneError: the scenes cannot be used, or were made with another perception.
        ValueError: p_hat is none of ``task.p_hat.TESTED``.
    """
    kind = check_kind(p_hat, TESTED)
    candidate = Candidate.load(path)
    if candidate.reads_sightings and "own" in SOURCES[kind].needs:
        raise ValueError(
            f"found p_hat {kind!r} for {path}, which sees no pictures on the robot, from which its "
            "predictor learnt; choose lidar (cfnav rooms scan, cfnav data lidar), true or zero"
        )
    starts = read_episodes(frozen)[:most] if frozen else []
    bank = SceneBank.load(scenes, rooms or sorted({s.scene for s in starts}))
    check_fits(candidate, path, bank, scenes)
    drawn = Episodes.thaw(bank, starts) if frozen else Episodes.draw(bank, episodes, seed)
    lidar = lidar_of(scenes, bank.names) if veto or needs_lidar(kind) else None
    trace: list[Trace] = []
    results = run_episodes(
        candidate.networks, bank, drawn, seed if sample else None, kind, lidar, veto, trace
    )
    what = {**candidate.what, "sample": sample, "p_hat": kind, "veto": veto}
    return Evaluation(what, candidate.goals, bank, drawn, results, trace)


def paired_difference(a: Evaluation, b: Evaluation) -> dict[str, Any]:
    """CF-SR of ``a`` minus ``b`` on the same episodes, see ``metrics.paired``.

    Under ``other_goals`` also of those whose goal ``a`` was not trained to find; None without any.

    Raises:
        ValueError: the episodes differ.
    """
    if a.episodes.identity(a.bank) != b.episodes.identity(b.bank):
        raise ValueError("found two evaluations of different episodes, expected the same")
    ours, other = (np.array([r.cf_success for r in of.results]) for of in (a, b))
    rest = ~a.trained
    of_rest = paired(ours[rest], other[rest], a.rooms[rest]) if rest.any() else None
    return {**paired(ours, other, a.rooms), "other_goals": of_rest}
