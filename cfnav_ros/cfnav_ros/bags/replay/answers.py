"""What bundles answer side by side to the moments of one bag, each told what was driven. Pure."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from cfnav_core.perception.perception import Perceived
from cfnav_core.policy.policy import Policy, View
from cfnav_core.task.actions import Action
from cfnav_core.task.pinhole import Pinhole
from cfnav_ros.bags.files.events import Event, Judged, Picture
from cfnav_ros.bags.replay.step import LeftOut, ReplayStep
from cfnav_ros.drive.camera_watch import WHOLE, Crop, fitting
from cfnav_ros.drive.inputs import DETECTIONS, PICTURE
from cfnav_ros.drive.limits import EpisodeLimits, given_p_hat

NOTHING = Event(t_ns=0)

Look = Callable[[int, int, np.ndarray], None]
"""Shown a picture that is decided on: its stamp, the time of the decision, RGB."""


@dataclass(frozen=True)
class Moment:
    """What one decision is taken on, and what was driven; see ``ReplayStep``."""

    t_ns: int
    step: int
    picture: Picture | None
    detections: Picture | None
    """What a detector said of it, with sightings in place of pixels."""
    estimate: Judged | None
    newest: Judged | None
    driven: Action
    vetoed: bool = False
    probabilities: np.ndarray | None = None
    p_hat: float | None = None
    met_before: bool = False

    @property
    def lidar(self) -> float | None:
        """What a policy that drives is given of the LiDAR."""
        judged = self.estimate
        return given_p_hat(judged.estimate, self.met_before) if judged else None


@dataclass
class _Runner:
    """A bundle at work: ``refused`` is a sentence on why it does not take the drive's goal."""

    name: str
    policy: Policy
    refused: str = ""
    intact: bool = False


class Answers:
    """Bundles at work over one bag.

    Attributes:
        steps: by drive and time, the bundles side by side.
        left_out: what could not be answered.
        camera: of the pictures that come, None where the bag does not say.
    """

    def __init__(
        self, policies: Mapping[str, Policy], limits: EpisodeLimits, bag: str, look: Look
    ) -> None:
        """The bundles by name, the policy node's limits, the bag's name, who sees pictures."""
        self.steps: list[ReplayStep] = []
        self.left_out: list[LeftOut] = []
        self.camera: Pinhole | None = None
        self._runners = [_Runner(name, policy) for name, policy in policies.items()]
        self._limits, self._bag, self._look = limits, bag, look
        self._open: list[ReplayStep] = []
        self._lidar_said: list[float] = []
        self._goal = self._driver = ""
        self._drive_ns = 0

    def begin(self, goal: str, t_ns: int, driver: str) -> None:
        """A drive begins; see ``Replay.begin``."""
        self._goal, self._driver, self._drive_ns = goal, driver, t_ns
        self._lidar_said.clear()
        for runner in self._runners:
            why = runner.policy.admits(goal)
            runner.refused = f"The bundle does not take this goal: {why}." if why else ""
            runner.intact = not why
            if not why:
                runner.policy.reset(goal)

    def missed(self) -> None:
        """Decisions are not in the bag: no bundle knows any more all that its driver saw."""
        for runner in self._runners:
            runner.intact = False

    def close(self, t_ns: int) -> None:
        """The last decision lasted until a time of the bag."""
        self.steps += [replace(step, until_ns=max(t_ns, step.t_ns)) for step in self._open]
        self._open = []

    def leave_out(self, step: int, t_ns: int, driven: Action, reason: str) -> None:
        """No bundle sees the picture of this decision."""
        self.left_out.append(LeftOut("", self._drive_ns, step, t_ns, reason))
        self.missed()
        for runner in self._runners:
            runner.policy.executed(driven)

    def answer(self, moment: Moment) -> None:
        """Let every bundle decide, then tell it what was driven."""
        rgb, problem = None, ""
        try:
            if moment.picture is not None:
                rgb = moment.picture.decode()
                self._look(moment.picture.t_ns, moment.t_ns, rgb)
        except ValueError as error:
            problem = str(error)
        if problem and not moment.detections:
            self.leave_out(moment.step, moment.t_ns, moment.driven, problem)
            return
        looks: dict[tuple[str, Crop], Perceived] = {}
        for runner in self._runners:
            if runner.refused:
                self._refuse(runner.name, moment, runner.refused)
                continue
            policy = runner.policy
            try:
                crop = self._crop(policy)
                seen = policy.perception, crop
                if seen not in looks:
                    looks[seen] = policy.look(self._view_of(policy, moment, rgb, crop))
                self._open.append(self._step_of(runner, looks[seen], moment))
            except ValueError as error:
                runner.intact = False
                self._refuse(runner.name, moment, f"Not decided: {str(error).rstrip('.')}.")
            policy.executed(moment.driven)
        if moment.lidar is not None:
            self._lidar_said.append(moment.lidar)

    def _view_of(self, policy: Policy, moment: Moment, rgb: np.ndarray | None, crop: Crop) -> View:
        """What a policy looks at.

        Raises:
            ValueError: it is not in the bag, or means nothing.
        """
        if policy.reads_sightings and moment.detections:
            return moment.detections.decode()
        if policy.reads_sightings or rgb is None:
            wanted = DETECTIONS if policy.reads_sightings else PICTURE
            raise ValueError(f"the bag holds no {wanted} of this decision")
        return crop.of(rgb)

    def _crop(self, policy: Policy) -> Crop:
        """What the live node would show a policy of a picture; all where it would not drive."""
        learnt, found = policy.camera, self.camera
        return (fitting(learnt, found) if learnt and found else None) or WHOLE

    def _refuse(self, bundle: str, moment: Moment, reason: str) -> None:
        """One bundle does not answer a decision."""
        self.left_out.append(LeftOut(bundle, self._drive_ns, moment.step, moment.t_ns, reason))

    def _step_of(self, runner: _Runner, seen: Perceived, moment: Moment) -> ReplayStep:
        judged, blind = moment.estimate, runner.policy.reads_sightings
        p_hat_rgb = math.nan if blind else runner.policy.predict_collision(seen)
        # a recorded decision without a scan was taken on the bundle's own
        kind = self._limits.p_hat_kind if judged else "own"
        decision = runner.policy.decide(seen, moment.lidar, kind, tuple(self._lidar_said))
        looks = [j.estimate for j in (judged, moment.newest) if j] if judged else []
        closed = self._limits.forbids(looks, moment.met_before)
        vetoed = decision.action is Action.MoveAhead and closed
        return ReplayStep(
            bag=self._bag, bundle=runner.name, driver=self._driver, drive_ns=self._drive_ns,
            goal=self._goal, step=moment.step, t_ns=moment.t_ns, until_ns=moment.t_ns,
            image_ns=(moment.picture or moment.detections or NOTHING).t_ns,
            estimate_ns=judged.t_ns if judged else 0,
            driven=moment.driven, driven_vetoed=moment.vetoed,
            driven_probabilities=moment.probabilities, driven_p_hat=moment.p_hat,
            action=decision.action, probabilities=decision.probabilities,
            p_hat=decision.collision_probability, p_hat_rgb=p_hat_rgb,
            p_hat_lidar=judged.estimate.probability if judged else math.nan,
            detection_score=decision.detection_score, would_veto=vetoed, intact=runner.intact,
        )  # fmt: skip
