"""How the base conducts itself in one episode: where it goes, what it hits, whether it obeys. Pure.

Time is node time in seconds.
"""

from __future__ import annotations

from cfnav_ros.disturbance import Standing
from cfnav_ros.inputs import NEVER, Inputs
from cfnav_ros.limits import EpisodeLimits
from cfnav_ros.motion import Motion, Status
from cfnav_ros.track import Track

PRESSED_S = 0.3
"""A front bumper reported within this time is still pressed (reports come at 20 Hz or more)."""

REFLEX_S = 2.0
"""A base that moves by itself so soon after a bump backs off by reflex (create3_sim: at most 0.15 m
at 0.14 m/s); nobody pushes it."""


class Conduct:
    """Follows the base; each method returns one sentence when the episode must end, else empty."""

    def __init__(self, limits: EpisodeLimits) -> None:
        self.track = Track()
        self.pushes = 0
        self.displaced = False
        """Whether the base moved by itself since ``look``."""
        self.stands_from = 0.0
        """What was seen before this time was seen from elsewhere, or on the way."""
        self._limits = limits
        self._standing = Standing()
        self._begun = NEVER
        self._failed_motions = self._stalls = 0

    def start(self, t: float, inputs: Inputs) -> None:
        """The episode drives from now on; what was reported before is old."""
        self.track = Track(inputs.arrived.get("bumped_at", NEVER))
        self.stands_from = self._begun = t

    def look(self) -> None:
        """What is seen now is decided on."""
        self.displaced = False

    def rests(self) -> bool:
        """Whether the base stands."""
        return self.track.still_since is not None

    def follow(self, t: float, inputs: Inputs, motion: Motion | None) -> str:
        """Take account of odometry, bumps, and motion that nobody commanded."""
        sample = inputs.odometry
        bumped = self.track.bump(inputs.arrived.get("bumped_at", NEVER))
        if motion and (bumped or self._reported(t, inputs, "front_bumped_at", PRESSED_S)):
            motion.bump()
        if not self.track.odometry(sample):
            return "Odometry jumped: its pose was reset, or the robot was moved."
        if motion:
            self._standing.release()
            slip = self.track.slip.complaint()
            if slip:
                motion.block(slip, Status.STALLED)
        elif self._standing.moved(sample, self.rests()):
            return self._pushed(t, inputs)
        return ""

    def end_motion(self, t: float, inputs: Inputs, motion: Motion, status: Status) -> str:
        """Keep account of motions that failed in a row; too many are the end."""
        self.stands_from = t
        limits = self._limits
        self._failed_motions = 0 if status is Status.SUCCEEDED else self._failed_motions + 1
        self._stalls = self._stalls + 1 if status is Status.STALLED else 0
        if self._stalls >= limits.max_stalls:
            return f"{self._stalls} motions failed: {motion.reason}"
        if self._failed_motions >= limits.max_failed_motions:
            return f"{self._failed_motions} motions failed: {motion.reason}"
        return self._pushed(t, inputs) if status is Status.PUSHED else ""

    def _reported(self, t: float, inputs: Inputs, name: str, limit: float) -> bool:
        """Whether a report came in the last ``limit`` seconds, and not before the episode.

        Its stamp does not matter: some senders' clocks differ, others never set one.
        """
        came = inputs.arrived.get(name, NEVER)
        return came > self._begun and t - came < limit

    def _pushed(self, t: float, inputs: Inputs) -> str:
        """The base moved by itself: what was seen before is of another place."""
        self.stands_from, self.displaced = t, True
        if self._reported(t, inputs, "bumped_at", REFLEX_S):
            return ""
        self.pushes += 1
        if self.pushes < self._limits.max_pushes:
            return ""
        return (
            f"The base moved by itself {self.pushes} times: a reflex of its own, or somebody "
            "pushes it."
        )
