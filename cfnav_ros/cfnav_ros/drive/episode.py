"""The life of one goal on the robot: preflight, then observe, think, move until an outcome.

Pure: time, inputs and the policy are arguments, velocities are results. Whatever is unclear is
answered with zero velocity; what stays unclear ends the episode.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from math import inf, radians
from typing import TYPE_CHECKING

from cfnav_core.task.actions import Action
from cfnav_core.task.camera import MAST
from cfnav_ros.drive.conduct import RESTLESS, Conduct
from cfnav_ros.drive.inputs import SensorInputs
from cfnav_ros.drive.limits import EpisodeLimits, given_p_hat, with_live
from cfnav_ros.drive.motion import Motion, Status
from cfnav_ros.drive.own_motion import NOT_BACK, NOT_LEFT, Begin, OwnMotion
from cfnav_ros.drive.phases import DOCKS_AFTER, NOT_DRIVEN, Output, Phase, StepRecord
from cfnav_ros.drive.track import Stop, Track
from cfnav_ros.drive.watch import Watch
from cfnav_ros.lidar.estimate import Verdict
from cfnav_ros.robot.stamps import NEVER

if TYPE_CHECKING:
    from cfnav_core.policy.policy import Decision, Policy

REST_TIMEOUT_S = 2.0
"""A robot that still moves this long after the end is reported as it is."""


class Episode:
    """Drives one goal; ``update`` at the velocity rate until ``ended``."""

    def __init__(
        self,
        goal: str,
        policy: Policy,
        submit: Callable[..., Future],
        limits: EpisodeLimits,
        time_limit: float = 0.0,
        undock: Begin | None = None,
        dock: Begin | None = None,
    ) -> None:
        """Prepare an episode; nothing happens before the first ``update``.

        Args:
            goal: category to look for.
            policy: reset and asked through ``submit``, one call at a time.
            submit: like ``concurrent.futures.Executor.submit``; where the policy runs.
            limits: see EpisodeLimits.
            time_limit: seconds of node time from the first preflight off the dock, 0 for none.
            undock: has the base leave its dock; None: a robot on it is refused.
            dock: has the base go back to it after a drive; None: it stays where it is.
        """
        self.goal = goal
        self.phase = Phase.PREFLIGHT
        self.outcome, self.message = "", ""
        self.steps, self.vetoes = 0, 0
        self.decision: Decision | None = None
        self._policy, self._submit = policy, submit
        self._limits, self._time_limit = limits, time_limit
        self._begun, self._t, self._since = NEVER, 0.0, 0.0
        self._watch = Watch(limits)
        self._conduct = Conduct(limits)
        self._origin = 0.0
        self._level, self._horizons = 0, (policy.camera or MAST).horizons
        self._motion: Motion | None = None
        self._observed = SensorInputs()
        self._lidar_said: list[float] = []
        self._met: Stop | None = None
        self._answer: Future | None = None
        self._undock, self._dock = undock, dock
        self._own: OwnMotion | None = None

    @property
    def begun(self) -> bool:
        """Whether the robot is off its dock and the drive begins, or has begun."""
        return self.phase not in NOT_DRIVEN

    @property
    def over(self) -> bool:
        """Whether the drive is over and the robot was told to stop for long enough."""
        return self.phase in (Phase.DOCK, Phase.ENDED)

    @property
    def ended(self) -> bool:
        """Whether it is over, and a robot that was to go back to its dock has, or has not."""
        return self.phase is Phase.ENDED

    @property
    def track(self) -> Track:
        """What the robot did so far."""
        return self._conduct.track

    @property
    def pushes(self) -> int:
        """How often the base moved by itself."""
        return self._conduct.pushes

    def finish(self, outcome: str, message: str) -> None:
        """End the episode: stop first, unless it never got to drive. The first call counts.

        A later one only keeps a robot from its dock, or stops it on the way there.
        """
        stop_first = not (self.over or self.phase in NOT_DRIVEN)
        if self._own is not None:
            self._own.cancel()
        if not self.outcome:
            self.outcome, self.message = outcome, message
        elif stop_first:
            self._dock = self._dock if outcome in DOCKS_AFTER else None
            return
        self.phase = Phase.STOPPING if stop_first else Phase.ENDED
        self._since = inf  # from the next update on, however far node time has leapt by then

    def fail(self, message: str) -> None:
        """End the episode because it cannot go on: refused before it drove, aborted after.

        An empty message is no reason to.
        """
        if message:
            self.finish("refused" if self.phase in NOT_DRIVEN else "aborted", message)

    def adopt(self, limits: EpisodeLimits) -> None:
        """Take what may change while an episode runs, for a motion under way too."""
        self._limits = with_live(self._limits, limits)
        if self._motion:
            self._motion.limits = self._limits.motion

    def update(self, t: float, inputs: SensorInputs) -> Output:
        """Advance to node time t (seconds) with the newest inputs.

        What may end the episode is looked at in the order of how much may go wrong; the first
        sentence counts.
        """
        if self._begun == NEVER:
            self._begun = self._since = self._t = t
            self._check_goal()
        if self.ended:
            return Output()
        self._check_clock(t)
        if self.phase is Phase.PREFLIGHT and inputs.docked and self._undock:
            self._begin_own(Phase.UNDOCK, t, self._undock, NOT_LEFT)
        if self._own is not None:
            self._follow_own(self._own, t, inputs)
            return Output()
        self.fail(self._watch.forbids(inputs))
        if self.phase is not Phase.PREFLIGHT:
            self.fail(self._conduct.follow(t, inputs, self._motion))
        stands = self._check_inputs(t, inputs)
        if self._time_limit and t - self._begun > self._time_limit:
            self.finish("time_limit", f"{self._time_limit:g} s have passed.")
        if self.phase is Phase.STOPPING:
            return self._stopping(t)
        if stands or self.ended:
            if self._motion:
                self._motion.pause(t, inputs.odometry)
                self._conduct.pause(t)
            return Output()
        phases = {
            Phase.PREFLIGHT: self._preflight,
            Phase.OBSERVE: self._observe,
            Phase.THINK: self._think,
            Phase.MOVE: self._move,
            Phase.TILT: self._tilt,
        }
        return phases[self.phase](t, inputs)

    def _enter(self, phase: Phase, t: float) -> None:
        self.phase, self._since = phase, t

    # Watching

    def _check_goal(self) -> None:
        if refusal := self._policy.admits(self.goal):
            self.fail(f"The policy does not take this goal: {refusal}.")
        if not 0.0 <= self._time_limit < inf:
            self.fail(f"time_limit is {self._time_limit:g} s, expected 0 (none) or more.")

    def _check_clock(self, t: float) -> None:
        before, self._t = self._t, t
        if t < before:
            self.fail("Node time jumped back.")
            self._since = t

    def _check_inputs(self, t: float, inputs: SensorInputs) -> bool:
        """Whether the robot must stand because of an input; ends the episode when that lasts."""
        limits, watch = self._limits, self._watch
        complaint = watch.stops(t, inputs)
        if self.phase is not Phase.PREFLIGHT:
            given_up = watch.gives_up(t, inputs, complaint)
        else:
            watch.start(t)
            late = t - self._begun > limits.preflight_timeout
            reason = complaint or watch.blindness(inputs) or "The policy is still busy."
            given_up = inputs.picture.fault or (reason if late else "")
        self.fail(given_up)
        return bool(complaint)

    # Motions of the base's own, before and after the drive

    def _begin_own(self, phase: Phase, t: float, begin: Begin, failed: str) -> None:
        limits = self._limits
        self._own = OwnMotion(t, begin, failed, limits.preflight_timeout, limits.dock_timeout)
        self._enter(phase, t)

    def _follow_own(self, own: OwnMotion, t: float, inputs: SensorInputs) -> None:
        """Wait until the base has left its dock, or is back on it; then go on, or end.

        Off the dock everything begins anew: sensors that slept there, and the odometry, which a
        base may reset.
        """
        leaves = self.phase is Phase.UNDOCK
        wrong = self._watch.forbids_own(inputs, leaves)
        if wrong and not leaves:
            self.message = f"{self.message} {wrong}".rstrip()
        self.fail(wrong)
        if self.ended:
            return
        failed = own.update(t, inputs.base.waiting, inputs.docked is not leaves)
        if failed is None:
            return
        self._own = None
        if leaves:
            self.fail(failed)
        else:
            self.message = f"{self.message} {failed}".rstrip()
        if not self.ended:
            self._begun = t
            self._enter(Phase.PREFLIGHT if leaves else Phase.ENDED, t)

    # Phases: each is one state of the machine

    def _preflight(self, t: float, inputs: SensorInputs) -> Output:
        answer = self._answer
        if answer is None:
            try:
                inputs.frame.decode()
            except ValueError as error:
                self.fail(str(error))
                return Output()
            answer = self._answer = self._submit(self._policy.reset, self.goal)
        if not inputs.base.ready or not answer.done() or self._watch.blindness(inputs):
            return Output()
        if answer.exception():
            self.fail(str(answer.exception()))
            return Output()
        self._answer = None
        self._watch.drive(inputs)
        self._conduct.start(t, inputs)
        self._origin = inputs.odometry.yaw
        return self._tilt_to(0, t)

    def _observe(self, t: float, inputs: SensorInputs) -> Output:
        if self.steps >= self._limits.max_steps:
            self.finish("step_limit", f"{self.steps} decisions were made without Done.")
        elif self._observable(inputs):
            self._ask(t, inputs)
        elif t - self._since > self._limits.observe_timeout:
            unseen = f"No new {inputs.view} or scan arrives of where the robot stands."
            rests = self._conduct.rests()
            self.fail(self.track.slip.complaint() or (unseen if rests else RESTLESS))
        return Output()

    def _observable(self, inputs: SensorInputs) -> bool:
        """Whether picture and scan were both taken after the robot stood, and are new."""
        since = self.track.still_since
        if since is None:
            return False
        since = max(since, self._conduct.stands_from)
        seen = inputs.made("frame") >= since + self._limits.settle
        scanned = not self._limits.lidar or inputs.made("estimate") >= since
        return seen and scanned and inputs.frame.stamp_ns > self._observed.frame.stamp_ns

    def _ask(self, t: float, inputs: SensorInputs) -> None:
        try:
            view = inputs.frame.decode()
        except ValueError as error:
            self.fail(str(error))
            return
        self._met = self._conduct.met.ahead(inputs.odometry)
        said = given_p_hat(inputs.estimate.estimate, self._met is not None)
        lidar = said if self._limits.lidar else None
        self._answer = self._submit(
            self._policy.act, view, lidar, self._limits.p_hat_kind, tuple(self._lidar_said)
        )
        if lidar is not None:
            self._lidar_said.append(lidar)
        self._observed = inputs
        self._conduct.look()
        self._enter(Phase.THINK, t)

    def _think(self, t: float, inputs: SensorInputs) -> Output:
        answer, seen = self._answer, self._observed
        assert answer is not None
        moving = self._conduct.displaced and not self._conduct.rests()
        if not answer.done() or moving:
            late = "The base moves by itself." if moving else "The policy did not answer in time."
            if t - self._since > self._limits.think_timeout:
                self.fail(late)
            return Output()
        if answer.exception():
            self.fail(f"The policy failed: {answer.exception()}")
            return Output()
        decision: Decision = answer.result()
        self.decision = decision
        vetoed = self._vetoes(decision.action, inputs)
        self.steps += 1
        self.vetoes += vetoed
        scan_ns = seen.estimate.stamp_ns if self._limits.lidar else 0
        record = StepRecord(
            self.steps, decision, seen.frame.stamp_ns, scan_ns, vetoed, self._met is not None
        )
        if vetoed:
            self._enter(Phase.OBSERVE, t)
            if self._met and self._limits.veto and decision.action is Action.MoveAhead:
                self.fail(self._conduct.meet_again(self._met))
            return Output(record=record)
        return replace(self._execute(decision.action, t, inputs), record=record)

    def _vetoes(self, action: Action, inputs: SensorInputs) -> bool:
        """Whether an action needs another look instead.

        The way ahead was not free when it was looked at, or is not free any more, or something
        was met there; or what the action is about was seen from another place: the way, or the
        goal. A turn keeps to its heading wherever it starts.
        """
        if action not in (Action.MoveAhead, Action.Done):
            return False
        looks = (self._observed.estimate.estimate, inputs.estimate.estimate)
        closed = self._limits.forbids(looks, self._met is not None)
        return (action is Action.MoveAhead and closed) or self._conduct.displaced

    def _execute(self, action: Action, t: float, inputs: SensorInputs) -> Output:
        if action is Action.Done:
            self.finish("done", f"The policy says that it sees the {self.goal}.")
            return Output()
        if action in (Action.LookUp, Action.LookDown):
            step = -1 if action is Action.LookUp else 1
            return self._tilt_to(min(max(self._level + step, 0), len(self._horizons) - 1), t)
        self._motion = Motion(action, t, inputs.odometry, self._origin, self._limits.motion)
        self._enter(Phase.MOVE, t)
        return Output()

    def _tilt_to(self, level: int, t: float) -> Output:
        """Tilt the camera to one of the policy's horizons; without a tilt this succeeds unmoved."""
        self._level = level
        self._enter(Phase.TILT if self._limits.has_tilt else Phase.OBSERVE, t)
        return Output(tilt=self._horizons[level] if self._limits.has_tilt else None)

    def _tilt(self, t: float, inputs: SensorInputs) -> Output:
        target = self._horizons[self._level]
        reached = abs(inputs.tilt.angle - target) <= radians(self._limits.tilt_tolerance_deg)
        if reached and inputs.tilt.stamp > self._since:
            self._conduct.stands_from = t
            self._enter(Phase.OBSERVE, t)
        elif t - self._since > self._limits.tilt_timeout:
            stays = f"The camera stays at {inputs.tilt.angle:.2f} rad, expected {target:.2f}"
            self.fail(f"{stays} within {self._limits.tilt_timeout:g} s: does its driver run?")
        return Output(tilt=target)

    def _move(self, t: float, inputs: SensorInputs) -> Output:
        motion = self._motion
        assert motion is not None
        self._guard(motion, inputs)
        command, status = motion.update(t, inputs.odometry)
        command = self._conduct.told(t, command)
        if status is Status.DRIVING:
            return Output(command)
        self._motion = None
        self._enter(Phase.OBSERVE, t)
        self.fail(self._conduct.end_motion(t, inputs.odometry, motion, status))
        return Output()

    def _guard(self, motion: Motion, inputs: SensorInputs) -> None:
        """Stop a MoveAhead when a scan taken on the way sees less room than the way then needed.

        The clearance keeps its margin; ``guard_slack`` is only what the way is not known by.
        """
        limits, seen = self._limits, inputs.estimate
        watched = limits.veto and motion.advances
        scanned = inputs.made("estimate")
        if not watched or scanned <= self._since:
            return
        needed = motion.remaining_at(scanned, inputs.odometry) - limits.guard_slack
        if seen.estimate.verdict is Verdict.BLIND or seen.estimate.clearance < needed:
            motion.block("The LiDAR sees the way closing.")

    def _stopping(self, t: float) -> Output:
        self._since = min(self._since, t)
        waited = t - self._since
        if waited >= self._limits.stop_time and (self._conduct.rests() or waited >= REST_TIMEOUT_S):
            self._enter(Phase.ENDED, t)
            if self._dock and self.outcome in DOCKS_AFTER:
                self._begin_own(Phase.DOCK, t, self._dock, NOT_BACK)
        return Output()
