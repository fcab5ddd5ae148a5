"""How late the base does what it is told. Pure; time is node time, seconds.

Commands that wait in a queue (a busy relay, a slow network) are all carried out in the end: a robot
that is then told to stop drives on for as long as they are late. So a base that does not begin to
move is told to stand before much is queued, and what it does later tells how late it was.
"""

from __future__ import annotations

from cfnav_ros.drive.motion import STOP, Command, Odometry

OWN_S = 0.15
"""What the simulated base needs by itself: latency, acceleration, two odometry samples at 20 Hz."""

STOPPING_S = 0.3
"""In which a base of 0.9 m/s^2 comes to rest from 0.2 m/s, once it has been told to."""

SLOWEST, STANDING = Command(0.03, 0.08), Command(0.015, 0.04)
"""Slower commands are not judged, and slower bases stand: m/s, rad/s."""

HALTED = 2
"""Odometry samples in a row that show a base which stands in the midst of a motion."""

TRIES = 2
"""Motions that may be begun while none has been obeyed: what is queued of them stays shorter than
one MoveAhead, which was free when it was decided on."""

REMEMBERED_S = 15.0
"""A base that moves so long after a command that it did not obey may obey it now."""


class Lag:
    """Follows what was sent and what the base does."""

    def __init__(self, most: float) -> None:
        """Allow commands to come ``most`` seconds late; 0 is any time."""
        self._limit = most + OWN_S
        self._off = most == 0
        self._asked = self._sent = STOP
        self._begun = 0.0
        self._paused = self._halted = False
        self._halts, self._moved_at = 0, 0.0
        self._unobeyed: float | None = None
        self._tries = 0
        self._moves_from: float | None = None
        self._stopping: tuple[float, Command] | None = None
        self._stamp = float("-inf")

    def told(self, t: float, asked: Command) -> Command:
        """What is sent at node time t for a velocity that is asked for, seconds.

        Returns:
            Zero in place of it while the base has not done yet what it was told.
        """
        begins = _moves(asked) and not _moves(self._asked)
        if begins or (self._paused and _moves(asked)):
            self._begun, self._tries, self._moves_from = t, self._tries + begins, None
            self._halted, self._halts = False, 0
        self._asked, self._paused = asked, False
        sent, before = STOP if self._waits() else asked, self._sent
        self._sent = sent
        if _moves(sent):
            self._stopping = None
            self._unobeyed = t if begins and self._unobeyed is None else self._unobeyed
        elif _moves(before):
            self._stopping = (t, before)
        return sent

    def pause(self, t: float) -> None:
        """Zero is sent at node time t, seconds, in the midst of a motion that goes on later."""
        if _moves(self._sent):
            self._stopping = (t, self._sent)
        self._sent, self._paused = STOP, True

    def _waits(self) -> bool:
        """Whether the newest odometry shows a base that has not done yet what it was told."""
        if self._off or self._unobeyed is None or self._moves_from is not None:
            return False
        late = self._stamp - self._begun > self._limit
        return late or self._halted or self._tries > TRIES

    def late(self, sample: Odometry) -> float:
        """Take the newest odometry.

        Returns:
            By how much a command came too late, seconds; 0 while there is nothing to complain of.
        """
        if self._off or sample.stamp <= self._stamp:
            return 0.0
        self._stamp = sample.stamp
        return self._began_late(sample) or self._stopped_late(sample)

    def _began_late(self, sample: Odometry) -> float:
        moves = _moves(Command(sample.v, sample.w), STANDING)
        since = self._unobeyed
        if since is None:
            self._watch_halt(sample.stamp, moves)
            return 0.0
        if sample.stamp < since:
            return 0.0
        if sample.stamp - since > REMEMBERED_S:
            self._obeyed()
            return 0.0
        if not moves:
            self._moves_from = None
            return 0.0
        if self._moves_from is None:  # one sample may be noise
            self._moves_from = sample.stamp
            return 0.0
        late = self._moves_from - since
        self._obeyed()
        return late if late > self._limit else 0.0

    def _watch_halt(self, stamp: float, moves: bool) -> None:
        """A base that obeyed stands in the midst of a motion: it hears nothing, or only later."""
        if moves:
            self._moved_at = stamp
        self._halts = 0 if moves or not _moves(self._sent) else self._halts + 1
        if self._halts >= HALTED and stamp - self._begun > self._limit:
            self._unobeyed, self._halted = max(self._moved_at, self._begun), True

    def _obeyed(self) -> None:
        self._unobeyed, self._tries, self._moves_from = None, 0, None

    def _stopped_late(self, sample: Odometry) -> float:
        if self._stopping is None:
            return 0.0
        t, told = self._stopping
        goes_on = sample.v * told.v > STANDING.v * abs(told.v) or (
            sample.w * told.w > STANDING.w * abs(told.w)
        )
        late = sample.stamp - t
        if sample.stamp > t and not goes_on:
            self._stopping = None
        elif late > self._limit + STOPPING_S:
            self._stopping = None
            return late
        return 0.0


def _moves(velocity: Command, least: Command = SLOWEST) -> bool:
    return abs(velocity.v) >= least.v or abs(velocity.w) >= least.w
