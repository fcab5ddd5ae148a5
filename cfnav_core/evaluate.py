"""Frozen episodes over offline scenes, and the figures of a policy on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from cfnav_core.actions import NUM_ACTIONS, Action
from cfnav_core.agent import TrainedAgent
from cfnav_core.bundle import BundleHead, find_bundle
from cfnav_core.config import PHat
from cfnav_core.env import SceneBank
from cfnav_core.metrics import EpisodeResult, bootstrap_interval, figures
from cfnav_core.models import MODELS
from cfnav_core.networks import Networks, OnnxNetworks, Sight, TorchNetworks, sampled
from cfnav_core.perception import Perception
from cfnav_core.published.keys import Key, state_of
from cfnav_core.published.start_states import StartState, identity, read_episodes
from cfnav_core.scene import SceneError
from cfnav_core.scenes import lidar_of
from cfnav_core.vocabulary import ROOM_TYPES

VETO_PROBABILITY = 0.5
"""From which the LiDAR forbids a MoveAhead; the policy node's default."""

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
            SceneError: a scene, state or goal is not there.
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
        return cls(np.array(states, np.int64), np.array(goals, np.int64))

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
        p_hat: what the policy is given; see ``PHat``.
        lidar: float32 [S], what the LiDAR node says in every state; for p_hat "lidar" or
            "both", and for the veto.
        veto: a MoveAhead that the LiDAR forbids is not carried out, as on the robot.
        trace: gets what happened at each step.

    Returns:
        Results with lengths in actions, Done included.
    """
    n = len(episodes.states)
    state = networks.zero_state(n)
    where = episodes.states.copy()
    goals = np.eye(len(bank.objects), dtype=np.float32)[episodes.goals]
    rooms = np.eye(len(ROOM_TYPES), dtype=np.float32)[bank.room[where]]
    alive, success = np.ones(n, bool), np.zeros(n, bool)
    steps, collisions = np.zeros(n, int), np.zeros(n, int)
    limit = bank.step_limit[where]
    rng = np.random.default_rng(0 if sample_seed is None else sample_seed)
    for _ in range(int(limit.max())):
        at = where[alive]
        now = state.rows(alive)
        features, detections = bank.observe(torch.from_numpy(at))
        sight = Sight(features.cpu().numpy(), detections.cpu().numpy(), goals[alive], rooms[alive])
        given = None
        if p_hat == "zero":
            given = np.zeros(len(at), np.float32)
        elif p_hat == "true":
            given = bank.collided[at].astype(np.float32)
        elif p_hat == "shuffled":
            given = rng.permutation(networks.predict(sight, now))
        elif p_hat == "lidar":
            assert lidar is not None
            given = lidar[at]
        elif p_hat == "both":
            assert lidar is not None
            given = np.maximum(lidar[at], networks.predict(sight, now))
        pi, heard = networks.step(sight, now, given)
        action = pi.argmax(1)
        if sample_seed is not None:
            action = sampled(pi, rng)
        now.previous_action = np.eye(NUM_ACTIONS, dtype=np.float32)[action]
        state.put(alive, now)
        if trace is not None:
            trace.append(Trace(np.flatnonzero(alive), at, action, heard))
        done, ahead = action == Action.Done, action == Action.MoveAhead
        forbidden = np.zeros(len(at), bool)
        if veto:
            assert lidar is not None
            forbidden = ahead & (lidar[at] >= VETO_PROBABILITY)
        steps[alive] += 1
        collisions[alive] += ahead & bank.collided[at] & ~forbidden
        success[alive] = done & bank.visible[at, episodes.goals[alive]]
        where[alive] = np.where(forbidden, at, bank.next_state[at, action])
        alive[alive] = ~done
        alive &= steps < limit
        if not alive.any():
            break
    shortest = bank.actions_to[episodes.states, episodes.goals] + 1
    return [
        EpisodeResult(bool(s), int(c), float(d), float(best))
        for s, c, d, best in zip(success, collisions, steps, shortest, strict=True)
    ]


@dataclass(frozen=True)
class Evaluation:
    """Results of one bundle or checkpoint on one set of frozen episodes.

    Attributes:
        what: path, model, method, seed, commit and training episodes of what was evaluated.
        trace: every step of the episodes.
    """

    what: dict[str, Any]
    bank: SceneBank
    episodes: Episodes
    results: list[EpisodeResult]
    trace: list[Trace]

    @property
    def rooms(self) -> np.ndarray:
        """[N], the name of each episode's scene."""
        return np.array(self.bank.names)[self.bank.scene[self.episodes.states]]

    def summary(self) -> dict[str, Any]:
        """What was evaluated, and its figures: all, the long ones, by goal and by room type."""
        rooms = self.rooms
        long = [i for i, r in enumerate(self.results) if r.shortest_path_length >= LONG_EPISODE]
        by_goal = {
            self.bank.objects[g]: _cf_sr_of(self.results, self.episodes.goals == g)
            for g in np.unique(self.episodes.goals)
        }
        kinds = np.array(ROOM_TYPES)[self.bank.room[self.episodes.states]]
        return {
            **self.what,
            **figures(self.results, rooms),
            "long": figures([self.results[i] for i in long], rooms[long]) if long else None,
            "cf_sr_by_room_type": {
                k: _cf_sr_of(self.results, kinds == k) for k in np.unique(kinds)
            },
            "cf_sr_by_goal": by_goal,
            "episodes_identity": self.episodes.identity(self.bank),
            "scenes": self.bank.names,
        }


def _cf_sr_of(results: list[EpisodeResult], chosen: np.ndarray) -> dict[str, float]:
    values = [r.cf_success for r, c in zip(results, chosen, strict=True) if c]
    return {"cf_sr": round(float(np.mean(values)), 4), "episodes": len(values)}


@dataclass(frozen=True)
class Candidate:
    """A policy to evaluate.

    Attributes:
        networks: its own.
        perception: identity of what made the pictures' features that it reads.
        objects: what it reads detections of.
        what: see ``Evaluation``.
    """

    networks: Networks
    perception: str
    objects: tuple[str, ...]
    what: dict[str, Any]

    @classmethod
    def load(cls, path: Path) -> Candidate:
        """Open a bundle, by folder or shipped name, or a checkpoint's file.

        Raises:
            BundleError: the bundle cannot be used.
            CheckpointError: the checkpoint cannot be used.
        """
        if path.is_file():
            trained = TrainedAgent.load(path)
            networks = TorchNetworks(
                trained.agent.model, trained.agent.predictor, trained.feeds_prediction
            )
            what = {"checkpoint": str(path), **_origin(trained.head)}
            return cls(networks, trained.head["perception"], trained.inputs.objects, what)
        folder = find_bundle(path)
        head = BundleHead.load(folder)
        perception = Perception(folder / "perception.onnx").identity
        what = {"bundle": str(path), **_origin(head.training)}
        return cls(OnnxNetworks(folder, head), perception, head.objects, what)


def _origin(head: dict[str, Any]) -> dict[str, Any]:
    config = head["config"]
    name = config["model"]
    # a bundle may be another version's
    title = MODELS[name].title if name in MODELS else name
    return {
        "model": title, "method": config["method"], "seed": config["seed"],
        "commit": head["commit"], "training_episodes": head["episodes"],
    }  # fmt: skip


def evaluate(
    path: Path, scenes: Path, episodes: int, seed: int, sample: bool = False,
    p_hat: PHat = "own", rooms: Sequence[str] = (), frozen: Path | None = None,
    veto: bool = False, most: int | None = None,
) -> Evaluation:  # fmt: skip
    """Run a bundle or a checkpoint on frozen episodes: of a file, or drawn from a seed.

    The first ``most`` of a file when there are more.

    Raises:
        BundleError: the bundle cannot be used.
        CheckpointError: the checkpoint cannot be used.
        SceneError: the scenes cannot be used, or were made with another perception.
    """
    candidate = Candidate.load(path)
    starts = read_episodes(frozen)[:most] if frozen else []
    bank = SceneBank.load(scenes, rooms or sorted({s.scene for s in starts}))
    _check_fits(candidate, path, bank, scenes)
    drawn = Episodes.thaw(bank, starts) if frozen else Episodes.draw(bank, episodes, seed)
    lidar = lidar_of(scenes, bank.names) if veto or p_hat in ("lidar", "both") else None
    trace: list[Trace] = []
    results = run_episodes(
        candidate.networks, bank, drawn, seed if sample else None, p_hat, lidar, veto, trace
    )
    return Evaluation(candidate.what, bank, drawn, results, trace)


def _check_fits(candidate: Candidate, path: Path, bank: SceneBank, scenes: Path) -> None:
    if bank.perception != candidate.perception:
        remedy = "give scenes of the perception that it was trained with"
        if "bundle" in candidate.what:
            own = find_bundle(path) / "perception.onnx"
            remedy = f"make them with python -m sim_bridge.dataset --perception {own}"
        raise SceneError(
            f"found scenes in {scenes} made with perception {bank.perception}, but {path} has "
            f"{candidate.perception}; {remedy}"
        )
    if bank.objects != candidate.objects:
        raise SceneError(
            f"found scenes in {scenes} with {len(bank.objects)} objects, but {path} knows "
            f"{len(candidate.objects)} others or in another order; give scenes with its own"
        )


def paired_difference(a: Evaluation, b: Evaluation) -> dict[str, Any]:
    """CF-SR of ``a`` minus ``b`` on the same episodes, with its 95 % interval over rooms.

    Raises:
        ValueError: the episodes differ.
    """
    if a.episodes.identity(a.bank) != b.episodes.identity(b.bank):
        raise ValueError("found two evaluations of different episodes, expected the same")
    pairs = zip(a.results, b.results, strict=True)
    difference = np.array([int(x.cf_success) - int(y.cf_success) for x, y in pairs])
    return {
        "cf_sr_difference": float(difference.mean()),
        "interval": bootstrap_interval(difference, a.rooms),
    }
