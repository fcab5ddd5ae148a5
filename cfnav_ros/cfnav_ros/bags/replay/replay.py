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
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from cfnav_core.policy.policy import Policy
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
from cfnav_ros.bags.replay.answers import Answers, Look, Moment
from cfnav_ros.bags.replay.driven import DrivenActions
from cfnav_ros.bags.replay.estimates import Estimates, NodeTime
from cfnav_ros.bags.replay.kept_pictures import KeptPictures
from cfnav_ros.bags.replay.step import LeftOut, ReplayStep
from cfnav_ros.bags.replay.view import ReplayView, view
from cfnav_ros.drive.detection_watch import DetectionWatch
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.robot.stamps import seconds

WAIT_NS = 1_000_000_000
"""A picture or scan may be recorded so much later than the decision that was taken on it."""

MOST_WAITING = 100


@dataclass(frozen=True)
class _Asked:
    """A decision of the driver, and the newest estimate when it was published."""

    decided: Decided
    newest: Judged | None


class Replay:
    """Replays one bag; show it every event, then call ``finish``."""

    def __init__(
        self,
        policies: Mapping[str, Policy],
        estimates: Estimates,
        limits: EpisodeLimits | None = None,
        infer: bool = False,
        bag: str = "",
        watch: DetectionWatch | None = None,
        look: Look = lambda stamp_ns, t_ns, rgb: None,
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
            look: shown each picture that is decided on.
        """
        self._estimates, self._limits = estimates, limits or EpisodeLimits()
        self._answers = Answers(policies, self._limits, bag, look)
        self._node_time, self._now_ns = NodeTime(), 0
        self._clocks, self._t_ns = Clocks(), 0
        self._pictures, self._detections = KeptPictures(), KeptPictures()
        self._watch = watch
        self._tilt = math.nan
        self._waiting: deque[_Asked | Told] = deque()
        self._goal, self._step = "", 0
        self._driven = DrivenActions() if infer else None
        self._seen: tuple[int, ReplayView, ReplayView] | None = None

    @property
    def steps(self) -> list[ReplayStep]:
        """By drive and time, the bundles side by side."""
        return self._answers.steps

    @property
    def left_out(self) -> list[LeftOut]:
        """What could not be replayed."""
        return self._answers.left_out

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
        self._answers.camera = camera

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
        self._goal = goal
        self._answers.begin(goal, t_ns, driver)
        if self._driven is not None:
            self._driven.restart()

    def end(self, t_ns: int) -> None:
        """The drive, if any, ends at a time of the bag."""
        self._answers.close(t_ns)
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
        self._answers.close(decided.t_ns)
        self._follow_steps(decided)
        stamp_ns = decided.image_ns
        picture, detections = self._pictures.get(stamp_ns), self._detections.get(stamp_ns)
        estimate = self._estimate_of(decided)
        if picture is None and detections is None:
            reason = f"The bag holds no picture stamped {_s(decided.image_ns)}."
            self._answers.leave_out(decided.step, decided.t_ns, decided.action, reason)
        elif decided.estimate_ns and estimate is None:
            reason = f"No scan stamped {_s(decided.estimate_ns)} came in time to be judged again."
            self._answers.leave_out(decided.step, decided.t_ns, decided.action, reason)
        else:
            self._answers.answer(Moment(
                decided.t_ns, decided.step, picture, detections, estimate, asked.newest,
                decided.action, decided.vetoed, decided.probabilities,
                decided.collision_probability, decided.met_before,
            ))  # fmt: skip

    def _follow_steps(self, decided: Decided) -> None:
        """Begin a drive whose start is not in the bag; notice decisions that are not."""
        if decided.goal != self._goal or decided.step <= self._step:
            self.begin(decided.goal, decided.t_ns)
        if decided.step != self._step + 1:
            self._answers.missed()
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
            self._answers.leave_out(
                self._step, t_ns, action, wanted.complaint or pictures.complaint
            )
            return
        estimate = pictures.estimate
        self._answers.answer(Moment(t_ns, self._step, picture, said, estimate, estimate, action))
        self._answers.close(self._t_ns)


def _s(ns: int) -> str:
    return f"{ns // 1_000_000_000}.{ns % 1_000_000_000:09d} s"
