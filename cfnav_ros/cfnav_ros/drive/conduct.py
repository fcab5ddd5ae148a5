"""How the base conducts itself in one episode: where it goes, what it hits, whether it obeys. Pure.

Time is node time in seconds.
"""

from __future__ import annotations

from dataclasses import replace

from cfnav_ros.drive.disturbance import Standing
from cfnav_ros.drive.inputs import SensorInputs
from cfnav_ros.drive.lag import CLEAR_S, Lag
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.drive.motion import Command, Motion, Odometry, Status
from cfnav_ros.drive.track import Met, Stop, Track
from cfnav_ros.robot.stamps import NEVER

REFLEX_S = 2.0
"""A base that moves by itself so soon after a bump backs off by reflex (create3_sim: at most 0.15 m
at 0.14 m/s); nobody pushes it."""

MET = (Status.BUMPED, Status.STALLED)
"""Ends of a MoveAhead that something stopped: the bumper says so, or the wheels turn in vain. A
base that backs off by reflex and does not say why has met something, too."""

RESTLESS = "The base does not come to rest: it drives by itself, or somebody pushes it."


class Conduct:
    """Follows the base; each method returns one sentence when the episode must end, else empty."""

    def __init__(self, limits: EpisodeLimits) -> None:
        self.track = Track()
        self.met = Met()
        self.pushes = 0
        self.displaced = False
        """Whether the base moved by itself since ``look``."""
        self.stands_from = 0.0
        """What was seen before this time was seen from elsewhere, or on the way."""
        self._limits = limits
        self._standing = Standing()
        self._lag = Lag(limits.command_lag)
        self._begun = NEVER
        self._failed_motions = self._stalls = 0

    def start(self, t: float, inputs: SensorInputs) -> None:
        """The episode drives from now on; what was reported before is old.

        Also a bump of before node time began anew, whose time is yet to come.
        """
        self.track = Track(min(_bumped(t, inputs), t))
        self.stands_from = self._begun = t

    def look(self) -> None:
        """What is seen now is decided on."""
        self.displaced = False

    def told(self, t: float, command: Command) -> Command:
        """What is sent for a command at node time t: zero while the base is behind with others."""
        return self._lag.told(t, command)

    def pause(self, t: float) -> None:
        """Zero is sent at node time t, seconds, in the midst of a motion."""
        self._lag.pause(t)

    def rests(self) -> bool:
        """Whether the base stands."""
        return self.track.still_since is not None

    def follow(self, t: float, inputs: SensorInputs, motion: Motion | None) -> str:
        """Take account of odometry, bumps, and motion that nobody commanded."""
        sample = inputs.odometry
        bumped = self.track.bump(_bumped(t, inputs))
        if motion and (bumped or inputs.bumper):
            motion.bump()
        if not self.track.odometry(sample):
            return "Odometry jumped: its pose was reset, or the robot was moved."
        # A base whose clock is ahead would seem late by as much.
        if late := self._lag.late(replace(sample, stamp=inputs.made("odometry"))):
            return self._late(late, motion)
        if motion:
            self._standing.release()
            slip = self.track.slip.complaint()
            if slip:
                motion.block(slip, Status.STALLED)
        elif self._standing.moved(sample, self.rests()):
            return self._pushed(t)
        return ""

    def end_motion(self, t: float, at: Odometry, motion: Motion, status: Status) -> str:
        """Keep account of what was met, and of motions that failed in a row: too many are the end.

        Args:
            t: node time, seconds.
            at: where it ended.
            motion: that ended.
            status: how.
        """
        self.stands_from = t
        silence, reason = self._lag.silence(t), motion.reason
        if motion.advances and (status in MET or motion.backed_off) and not silence:
            self.met.take(Stop(at, status, reason))
        if status in (Status.STALLED, Status.LATE) and silence:
            reason = (
                f"The base has not moved {silence:.1f} s after it was told to: its commands come "
                "late or are lost, or it cannot move."
            )
        if failed := self._count(status, reason):
            return failed
        return self._pushed(t) if status is Status.PUSHED else ""

    def meet_again(self, stop: Stop) -> str:
        """A MoveAhead that leads to a stop is not driven again, and counts as one that was."""
        return self._count(stop.status, stop.reason)

    def _count(self, status: Status, reason: str) -> str:
        limits = self._limits
        self._failed_motions = 0 if status is Status.SUCCEEDED else self._failed_motions + 1
        self._stalls = self._stalls + 1 if status in (Status.STALLED, Status.LATE) else 0
        if self._stalls >= limits.max_stalls:
            return f"{self._stalls} motions failed: {reason}"
        if self._failed_motions >= limits.max_failed_motions:
            return f"{self._failed_motions} motions failed: {reason}"
        return ""

    def _late(self, late: float, motion: Motion | None) -> str:
        reason = (
            f"The base did {late:.1f} s late what it was told (limit {self._limits.command_lag:g} "
            "s): its commands wait somewhere on the way, such as in its relay or in a busy network."
        )
        if motion:
            motion.block(reason, Status.LATE)
        clear = late > self._limits.command_lag + CLEAR_S
        return reason if clear or self._lag.motions >= self._limits.max_lags else ""

    def _pushed(self, t: float) -> str:
        """The base moved by itself: what was seen before is of another place."""
        self.stands_from, self.displaced = t, True
        if self._begun < self.track.bumped_at and t - self.track.bumped_at < REFLEX_S:
            return ""
        self.pushes += 1
        if self.pushes < self._limits.max_pushes:
            return ""
        return (
            f"The base moved by itself {self.pushes} times: a reflex of its own, or somebody "
            "pushes it."
        )


def _bumped(t: float, inputs: SensorInputs) -> float:
    """When the bumper was last known to be pressed: now, or when the newest bump was reported.

    Its stamp does not matter: some senders' clocks differ, others never set one.
    """
    return t if inputs.bumper else inputs.arrived.get("bumped_at", NEVER)
