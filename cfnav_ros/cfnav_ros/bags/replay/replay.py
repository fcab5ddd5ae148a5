"""Runs bundles over a recorded drive as the live node would have: the same ``Policy``, in one pass.

Where the bag holds decisions, each is taken again on its own picture and with the collision
probability of its own scan, made again from the recorded scans; then the policy is told what the
driver decided. That is what a live policy knows of itself too: a vetoed MoveAhead stays its
previous action, as nobody tells it otherwise. Where the bag holds none, the driven actions are
those of ``driven`` and each decision is taken on what was newest when its action began, under the
live node's limits of age. Steps have the bag's one time (``clocks``); ages are those of node time.
Pure: pictures are kept undecoded for some seconds, and no more of them than a fixed number of
bytes.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cfnav_core.perception.perception import Perceived
from cfnav_core.policy.policy import Policy, View
from cfnav_core.task.actions import Action
from cfnav_core.task.pinhole import Pinhole
from cfnav_ros.bags.files.events import (
    Bumps,
    Calibrated,
    Decided,
    Detected,
    Event,
    Joint,
    Judged,
    LaserTurn,
    Picture,
    Pose,
    Told,
)
from cfnav_ros.bags.judge.clocks import Clocks
from cfnav_ros.bags.replay.driven import DrivenActions
from cfnav_ros.bags.replay.estimates import Estimates, NodeTime
from cfnav_ros.bags.replay.kept_pictures import KeptPictures
from cfnav_ros.bags.replay.step import LeftOut, ReplayStep
from cfnav_ros.bags.replay.view import ReplayView, view
from cfnav_ros.drive.camera_watch import WHOLE, Crop, fitting
from cfnav_ros.drive.detection_watch import DetectionWatch
from cfnav_ros.drive.inputs import DETECTIONS, PICTURE
from cfnav_ros.drive.limits import EpisodeLimits, given_p_hat
from cfnav_ros.robot.stamps import seconds

WAIT_NS = 1_000_000_000
"""A picture or scan may be recorded so much later than the decision that was taken on it."""

MOST_WAITING = 100

NOTHING = Event(t_ns=0)


@dataclass(frozen=True)
class _Asked:
    """A decision of the driver, and the newest estimate when it was published."""

    decided: Decided
    newest: Judged | None


@dataclass(frozen=True)
class _Moment:
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


class Replay:
    """Replays one bag; show it every event, then call ``finish``.

    Attributes:
        steps: by drive and time, the bundles side by side.
        left_out: what could not be replayed.
    """

    def __init__(
        self,
        policies: Mapping[str, Policy],
        estimates: Estimates,
        limits: EpisodeLimits | None = None,
        infer: bool = False,
        bag: str = "",
        watch: DetectionWatch | None = None,
        look: Callable[[int, int, np.ndarray], None] = lambda stamp_ns, t_ns, rgb: None,
    ) -> None:
        """Prepare.

        Args:
            policies: bundles by the name under which their steps are reported.
            estimates: of the same bag; shown each event before the replay is.
            limits: the policy node's: ages, veto, and whether it uses the LiDAR (only inferred
                decisions ask; recorded ones say so themselves). Its defaults when None.
            infer: the bag holds no decisions: infer the driven actions.
            bag: name of the bag.
            watch: makes sightings of what a detector says; None where no bundle reads them.
            look: shown each picture that is decided on: its stamp, the time of the decision, RGB.
        """
        self._look = look
        self.steps: list[ReplayStep] = []
        self.left_out: list[LeftOut] = []
        self._runners = [_Runner(name, policy) for name, policy in policies.items()]
        self._estimates, self._limits, self._bag = estimates, limits or EpisodeLimits(), bag
        self._node_time, self._now_ns = NodeTime(), 0
        self._clocks, self._t_ns = Clocks(), 0
        self._pictures, self._detections = KeptPictures(), KeptPictures()
        self._watch = watch
        self._camera: Pinhole | None = None
        self._tilt = math.nan
        self._waiting: deque[_Asked | Told] = deque()
        self._open: list[ReplayStep] = []
        self._lidar_said: list[float] = []
        self._goal, self._driver = "", ""
        self._drive_ns = self._step = 0
        self._driven = DrivenActions() if infer else None
        self._seen: tuple[int, ReplayView, ReplayView] | None = None

    def see(self, event: Event) -> None:
        """Take the next event of the bag."""
        self._now_ns, self._t_ns = self._node_time.at(event), self._clocks.time(event)
        if isinstance(event, Picture):
            self._pictures.add(event, self._now_ns)
        elif isinstance(event, Detected) and self._watch:
            self._detections.add(self._said(self._watch, event), self._now_ns)
        elif isinstance(event, Calibrated):
            self._calibrate(event.found)
        elif isinstance(event, LaserTurn) and self._watch:
            self._watch.hear(seconds(event.t_ns), event.scan)
        elif isinstance(event, Joint):
            self._tilt = event.angle
        elif isinstance(event, Told):
            self._waiting.append(replace(event, t_ns=self._t_ns))
        elif isinstance(event, Decided) and self._driven is None:
            asked = replace(event, t_ns=self._t_ns)
            self._waiting.append(_Asked(asked, self._estimates.newest[1]))
        if self._waiting:
            self._settle(event.log_ns)
        if self._driven is not None and isinstance(event, Pose | Bumps | Joint):
            self._infer(self._driven.see(event))

    def _calibrate(self, camera: Pinhole) -> None:
        if self._watch:
            self._watch.tell(camera)  # a bag may hold drives with several cameras
        self._camera = camera

    def _said(self, watch: DetectionWatch, event: Detected) -> Picture:
        """What a detector says as the live node would take it, or why it would not."""
        frame = watch.see(event.t_ns, event.claims, self._tilt)

        def decode() -> Any:
            if problem := frame.fault or frame.waiting:
                raise ValueError(problem)
            return frame.decode()

        return Picture(
            t_ns=event.t_ns, log_ns=event.log_ns, topic=event.topic, data=b"", decode=decode
        )

    def begin(self, goal: str, t_ns: int, driver: str = "") -> None:
        """A drive begins; recorded starts do this by themselves.

        Args:
            goal: object that is sought.
            t_ns: when, in the bag's one time.
            driver: name of the bundle that drives.
        """
        self.end(t_ns)
        self._goal, self._driver, self._drive_ns = goal, driver, t_ns
        self._lidar_said.clear()
        for runner in self._runners:
            why = runner.policy.admits(goal)
            runner.refused = f"The bundle does not take this goal: {why}." if why else ""
            runner.intact = not why
            if not why:
                runner.policy.reset(goal)
        if self._driven is not None:
            self._driven.restart()

    def end(self, t_ns: int) -> None:
        """The drive, if any, ends at a time of the bag."""
        self._close(t_ns)
        self._goal, self._step, self._seen = "", 0, None

    def stalled(self) -> None:
        """Inferred actions: the base stalls, which ends a MoveAhead under way as bumps do."""
        if self._driven is not None:
            self._infer(self._driven.stalled())

    def finish(self) -> None:
        """The bag ends."""
        self._settle(None)
        self.end(self._t_ns)

    # Recorded decisions

    def _settle(self, log_ns: int | None) -> None:
        """Go through what waits, in order, as far as it is there; None: nothing more will come."""
        while self._waiting:
            head = self._waiting[0]
            if isinstance(head, Told) and head.started:
                self.begin(head.goal, head.t_ns, head.bundle)
            elif isinstance(head, Told):
                self.end(head.t_ns)
            else:
                late = log_ns is None or not 0 <= log_ns - head.decided.log_ns <= WAIT_NS
                if not (late or len(self._waiting) > MOST_WAITING or self._is_there(head.decided)):
                    return
                self._decide_again(head)
            self._waiting.popleft()

    def _is_there(self, decided: Decided) -> bool:
        scanned = not decided.estimate_ns or self._estimates.made_from(decided.estimate_ns)
        kept = [kept for kept in (self._pictures, self._detections) if kept.newest[1]]
        return bool(scanned and kept) and all(each.get(decided.image_ns) for each in kept)

    def _decide_again(self, asked: _Asked) -> None:
        decided = asked.decided
        self._close(decided.t_ns)
        self._follow_steps(decided)
        stamp_ns = decided.image_ns
        picture, detections = self._pictures.get(stamp_ns), self._detections.get(stamp_ns)
        estimate = self._estimate_of(decided)
        if picture is None and detections is None:
            reason = f"The bag holds no picture stamped {_s(decided.image_ns)}."
            self._leave_out(decided.step, decided.t_ns, decided.action, reason)
        elif decided.estimate_ns and estimate is None:
            reason = f"No scan stamped {_s(decided.estimate_ns)} came in time to be judged again."
            self._leave_out(decided.step, decided.t_ns, decided.action, reason)
        else:
            self._answer(_Moment(
                decided.t_ns, decided.step, picture, detections, estimate, asked.newest,
                decided.action, decided.vetoed, decided.probabilities,
                decided.collision_probability, decided.met_before,
            ))  # fmt: skip

    def _follow_steps(self, decided: Decided) -> None:
        """Begin a drive whose start is not in the bag; notice decisions that are not."""
        if decided.goal != self._goal or decided.step <= self._step:
            self.begin(decided.goal, decided.t_ns)
        if decided.step != self._step + 1:
            for runner in self._runners:
                runner.intact = False
        self._step = decided.step

    def _estimate_of(self, decided: Decided) -> Judged | None:
        stamp_ns = decided.estimate_ns
        if not stamp_ns:
            return None
        made = self._estimates.made_from(stamp_ns)
        if made is None and decided.collision_probability == 1.0:
            # no scan's stamp: the live node was blind and stamped its estimate when it said so
            made = self._estimates.blind_at(stamp_ns)
        return made

    # Inferred decisions

    def _infer(self, driven: list[Action]) -> None:
        assert self._driven is not None
        for action in driven:
            self._take_inferred(action)
        if self._goal and (driven or self._seen is None or self._driven.at_keyframe):
            newest, kept = self._estimates.newest, (self._pictures, self._detections)
            pictures, detections = (view(self._now_ns, k, newest, self._limits) for k in kept)
            self._seen = self._t_ns, pictures, detections

    def _take_inferred(self, action: Action) -> None:
        if not self._goal or self._seen is None:
            return
        t_ns, pictures, detections = self._seen
        self._step += 1
        picture, said = (None if of.complaint else of.picture for of in (pictures, detections))
        if picture is None and said is None:
            wanted = pictures if self._pictures.newest[1] else detections
            self._leave_out(self._step, t_ns, action, wanted.complaint or pictures.complaint)
            return
        estimate = pictures.estimate
        self._answer(_Moment(t_ns, self._step, picture, said, estimate, estimate, action))
        self._close(self._t_ns)

    # Both

    def _leave_out(self, step: int, t_ns: int, driven: Action, reason: str) -> None:
        """No bundle sees the picture of this decision."""
        self.left_out.append(LeftOut("", self._drive_ns, step, t_ns, reason))
        for runner in self._runners:
            runner.intact = False
            runner.policy.executed(driven)

    def _answer(self, moment: _Moment) -> None:
        """Let every bundle decide, then tell it what was driven."""
        rgb, problem = None, ""
        try:
            if moment.picture is not None:
                rgb = moment.picture.decode()
                self._look(moment.picture.t_ns, moment.t_ns, rgb)
        except ValueError as error:
            problem = str(error)
        if problem and not moment.detections:
            self._leave_out(moment.step, moment.t_ns, moment.driven, problem)
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

    def _view_of(self, policy: Policy, moment: _Moment, rgb: np.ndarray | None, crop: Crop) -> View:
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
        learnt, found = policy.camera, self._camera
        return (fitting(learnt, found) if learnt and found else None) or WHOLE

    def _refuse(self, bundle: str, moment: _Moment, reason: str) -> None:
        """One bundle does not answer a decision."""
        self.left_out.append(LeftOut(bundle, self._drive_ns, moment.step, moment.t_ns, reason))

    def _step_of(self, runner: _Runner, seen: Perceived, moment: _Moment) -> ReplayStep:
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

    def _close(self, t_ns: int) -> None:
        """The last decision lasted until a time of the bag."""
        self.steps += [replace(step, until_ns=max(t_ns, step.t_ns)) for step in self._open]
        self._open = []


def _s(ns: int) -> str:
    return f"{ns // 1_000_000_000}.{ns % 1_000_000_000:09d} s"
