"""``Policy``: all a robot needs. The same object answers in bags, in tests and on the robot.

Back end onnx runs on ONNX Runtime alone. Back end torch runs the models themselves, as training
and evaluation do. Perception is ONNX Runtime's in both: it made the features of the scenes that
every policy was trained on, and they are rounded to float16, so that another's last digits could
become other features.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfnav_core.detect.sightings import Sighting, SightingEyes
from cfnav_core.perception.perception import (
    OnnxPerception,
    Perceived,
    Percept,
    Perception,
    PerceptionError,
)
from cfnav_core.policy.bundle import PERCEPTION, BundleError, BundleHead, find_bundle
from cfnav_core.policy.goals import refusal
from cfnav_core.policy.networks import (
    AgentState,
    Backend,
    Networks,
    Observation,
    open_networks,
    reads_room,
    sampled,
)
from cfnav_core.task.actions import NUM_ACTIONS, Action
from cfnav_core.task.detections import confidence_column, width
from cfnav_core.task.p_hat import Known, PHat, make_p_hat

__all__ = ["BundleError", "Decision", "Policy"]

View = np.ndarray | Sequence[Sighting]
"""What a policy looks at: a picture, uint8 [H, W, 3], or what a detector says of it."""


@dataclass(frozen=True)
class Decision:
    """One answer.

    Attributes:
        action: what to do: the most probable action, or a drawn one.
        probabilities: float32 [6], pi(a | I, g, p_hat).
        collision_probability: p_hat that the policy was given (or would have been, when its
            method feeds none).
        detection_score: 0..1, how surely the goal is seen in this picture.
    """

    action: Action
    probabilities: np.ndarray
    collision_probability: float
    detection_score: float


def eyes_of(folder: Path, head: BundleHead) -> OnnxPerception | SightingEyes:
    """What a bundle looks with.

    Raises:
        BundleError: its perception network cannot be used.
    """
    if head.reads_sightings:
        return SightingEyes(head.objects, head.features)
    try:
        return OnnxPerception(head.file(folder, PERCEPTION))
    except PerceptionError as error:
        raise BundleError(str(error)) from error


def check_fits(gives: Percept, head: BundleHead, where: str) -> None:
    """Raise BundleError when a perception does not give what a bundle's networks read.

    Args:
        gives: what it gives.
        head: of the bundle.
        where: the bundle, for the message.
    """
    pairs: list[tuple[str, Sequence[object], Sequence[object]]] = [
        ("features", gives.features, head.features)
    ]
    if gives.objects:
        pairs += [("objects", gives.objects, head.objects), ("fields", gives.fields, head.fields)]
    for what, found, expected in pairs:
        if found != expected:
            raise BundleError(
                f"found a perception in {where} with {what} {', '.join(map(str, found))}, but its "
                f"networks read {', '.join(map(str, expected))}; export it with its own"
            )


class Policy:
    """A bundle at work on one robot. Make it with ``Policy.load``.

    Attributes:
        name: of the bundle.
        goals: objects that it was trained to find; ``admits`` knows whether it takes others.
        camera: that it learnt from; None when nobody said.
        reads_sightings: whether it looks at what a detector says, of any camera, and at no picture;
            then it has no predictor of its own.
        perception: identity of its perception network; what policies of the same one ``look`` at,
            each of them can ``decide`` on.
    """

    def __init__(
        self,
        head: BundleHead,
        perception: Perception | SightingEyes,
        networks: Networks,
        sample_seed: int | None = None,
        reads_room: bool = False,
        room_type: str = "",
    ) -> None:
        self.name, self.perception = head.name, perception.identity
        self.reads_sightings = head.reads_sightings
        self.goals, self.camera = head.goals, head.camera
        self._head, self._reads_room, self._room_type = head, reads_room, room_type
        if room_type:
            self._check_room(room_type)
        self._objects = head.objects
        self._perception, self._networks = perception, networks
        self._rng = None if sample_seed is None else np.random.default_rng(sample_seed)
        self._goal, self._room = -1, self._no_room()
        self._counts = np.ones(len(head.objects), bool)
        self._score = confidence_column(head.fields)
        self._state = networks.zero_state(1)
        self._watching = networks.zero_state(1).predictor

    @classmethod
    def load(
        cls,
        bundle: Path | str | None = None,
        backend: Backend = "onnx",
        sample_seed: int | None = None,
        room_type: str = "",
    ) -> Policy:
        """Load a bundle, the default when None.

        Args:
            bundle: its folder, or the name of a shipped one.
            backend: what runs policy and predictor, see the module.
            sample_seed: draw actions with this seed, other ones in each episode; argmax when None.
            room_type: where the robot is, unless ``reset`` says otherwise; "" when nobody says.

        Raises:
            BundleError: missing, damaged, of another version, or without what the back end needs.
            ValueError: another back end, or a room type that the bundle does not know.
        """
        folder = find_bundle(bundle)
        head = BundleHead.load(folder)
        perception = eyes_of(folder, head)
        check_fits(perception.gives, head, str(folder))
        networks = open_networks(folder, head, backend)
        return cls(head, perception, networks, sample_seed, reads_room(folder), room_type)

    def admits(self, goal: str, room_type: str | None = None) -> str:
        """Why ``reset`` would refuse a goal, as one sentence; "" when it takes it.

        It takes what it was trained to find and, when its model allows that, all else that its
        perception detects; never a word for something that its perception cannot detect. A bundle
        that looks up what goes with what in a type of room must be told which one it is in.
        """
        if self._reads_room and not (room_type or self._room_type):
            return (
                f"found no room type for {self.name}, which looks up what goes with what there; "
                f"say which one the robot is in: {', '.join(self._head.room_types)} (the policy "
                "node's parameter room_type)"
            )
        return refusal(goal, self._head)

    def _check_room(self, room_type: str) -> None:
        known = self._head.room_types
        if room_type not in known:
            raise ValueError(
                f"found room type {room_type!r}, expected one that {self.name} knows: "
                f"{', '.join(known)}"
            )

    def reset(self, goal: str, room_type: str | None = None) -> None:
        """Begin an episode.

        Args:
            goal: one that it ``admits``.
            room_type: one that the bundle knows; only models that look it up need it. That which
                ``load`` was told when None.

        Raises:
            ValueError: a goal or room type that it does not take.
        """
        if refused := self.admits(goal, room_type):
            raise ValueError(refused)
        room_type = self._room_type if room_type is None else room_type
        if room_type:
            self._check_room(room_type)
        self._room = self._no_room()
        if room_type:
            self._room[0, self._head.room_types.index(room_type)] = 1
        self._goal = self._objects.index(goal)
        self._counts = np.array(
            [name == goal or name not in self._head.further for name in self._objects]
        )
        self._state = self._networks.zero_state(1)
        self._watching = self._networks.zero_state(1).predictor

    def _no_room(self) -> np.ndarray:
        return np.zeros((1, len(self._head.room_types)), np.float32)

    def __repr__(self) -> str:
        seeks = f"seeks {self._objects[self._goal]}" if self._goal >= 0 else "seeks nothing yet"
        return f"<Policy {self.name} ({self._head.method}): {len(self.goals)} goals, {seeks}>"

    def act(
        self,
        view: View,
        collision_probability: float | None = None,
        p_hat: PHat | None = None,
        earlier: Sequence[float] = (),
        *,
        goal: str | None = None,
    ) -> Decision:
        """Decide on one picture, or on what a detector says of it.

        Args:
            view: uint8 [H, W, 3], of the camera's shape; sightings for one that reads them.
            collision_probability: what a LiDAR says, or whoever else knows, 0..1.
            p_hat: which kind the policy is given, see ``task.p_hat``. When None that probability,
                or, where there is none, that of the bundle's own RGB predictor.
            earlier: such probabilities of the decisions before, for p_hat "earlier".
            goal: begins an episode when it is another than the present one, as ``reset`` does;
                not needed after ``reset``, which alone begins another episode of the same goal.

        Raises:
            PerceptionError: the picture cannot be used.
            ValueError: no goal was set, or one that it does not take, a probability is outside
                0..1, or what p_hat needs is not given.
        """
        if goal is not None and (self._goal < 0 or goal != self._objects[self._goal]):
            self.reset(goal)
        self._check(collision_probability)
        return self.decide(self.look(view), collision_probability, p_hat, earlier)

    def look(self, view: View) -> Perceived:
        """Observe one picture, uint8 [H, W, 3], of the camera's shape, or sightings.

        It remembers nothing.

        Raises:
            PerceptionError: it cannot be used.
        """
        return self._perception.observe(view)  # type: ignore[arg-type]  # each refuses the other

    def check_size(self, height: int, width: int) -> None:
        """Raise PerceptionError when pictures of a size, pixels, cannot be used."""
        if self.reads_sightings:
            raise PerceptionError("found a picture, expected sightings: this bundle sees none")
        self._perception.gives.check_size(height, width)

    def decide(
        self,
        seen: Perceived,
        collision_probability: float | None = None,
        p_hat: PHat | None = None,
        earlier: Sequence[float] = (),
    ) -> Decision:
        """Decide on what one picture shows, see ``act``.

        Args:
            seen: one picture of a policy with the same perception.
            collision_probability, p_hat, earlier: as for ``act``.

        Raises:
            ValueError: as for ``act``.
        """
        self._check(collision_probability)
        observation, given = self._observation(seen), collision_probability is not None
        known = Known(
            zero=np.zeros(1, np.float32),
            own=None
            if self.reads_sightings
            else lambda: self._networks.predict(observation, self._state),
            lidar=np.array([collision_probability], np.float32) if given else None,
            earlier=[np.array([p], np.float32) for p in earlier],
        )
        fed = make_p_hat(p_hat or ("lidar" if given else "own"), known)
        pi = self._networks.step(observation, self._state, fed)
        if not np.isfinite(pi).all():
            raise ValueError(
                f"found probabilities {pi[0].tolist()} of {self.name}, expected numbers"
            )
        action = Action(int(pi[0].argmax() if self._rng is None else sampled(pi, self._rng)[0]))
        self.executed(action)
        return Decision(action, pi[0], float(fed[0]), self._goal_score(seen))

    def predict_collision(self, seen: Perceived) -> float:
        """What the bundle's own RGB predictor says, whoever supplies p_hat to ``act``.

        It has a memory of its own for this: call it once a picture, before the decision. No answer
        of ``act`` depends on it.

        Args:
            seen: one picture of a policy with the same perception.

        Raises:
            ValueError: no goal was set, or it reads sightings: its predictor learnt from pictures.
        """
        self._check(None)
        if self.reads_sightings:
            raise ValueError(f"found no picture for the predictor of {self.name}, use the LiDAR's")
        state = AgentState({}, self._watching, self._state.previous_action)
        p_hat = self._networks.predict(self._observation(seen), state)
        self._watching = state.predictor
        return float(p_hat[0])

    def _check(self, collision_probability: float | None) -> None:
        if self._goal < 0:
            raise ValueError("found no goal; call reset(goal) before act")
        if collision_probability is not None and not 0.0 <= collision_probability <= 1.0:
            raise ValueError(f"found collision probability {collision_probability}, expected 0..1")

    def _observation(self, seen: Perceived) -> Observation:
        goal = np.eye(len(self._objects), dtype=np.float32)[[self._goal]]
        features, detections = (a.astype(np.float32) for a in (seen.features, seen.detections))
        if not detections.size:  # its networks read none
            detections = np.zeros((1, len(self._objects), width(self._head.fields)), np.float32)
        elif self._head.further:
            detections = np.where(self._counts[:, None], detections, 0)
        return Observation(features, detections, goal, self._room)

    def _goal_score(self, seen: Perceived) -> float:
        return float(seen.detections[0, self._goal, self._score]) if seen.detections.size else 0.0

    def executed(self, action: Action) -> None:
        """Say that another action than the last answer was executed (replay, veto)."""
        self._state.previous_action = np.eye(NUM_ACTIONS, dtype=np.float32)[[int(action)]]
