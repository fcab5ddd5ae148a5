"""How late the base does what it is told. Pure; time is node time, seconds.

Commands that wait in a queue (a busy relay, a slow network) are all carried out in the end: a robot
that is then told to stop drives on for as long as they are late. So a base that does not begin to
move is told to stand before much is queued, and what it does later tells how late it was.

A lag is what the newest odometry proves: the base still stood, or still moved, so long after it was
told otherwise. By one period of odometry it may have been later, and a base's own slowness to begin
(0.02 s in the mock) is part of it; the time that it must brake is not.
"""

from __future__ import annotations

from cfnav_ros.drive.motion import STOP, Command, Odometry

CLEAR_S = 0.1
"""A lag that is this much beyond the limit needs no second one, s: half a second shows as more."""

BRAKES = Command(0.9, 7.7)
"""By how much a Create 3 brakes in a second, m/s and rad/s."""

HELD_S = 0.5
"""How long a base goes on with the last command that it heard: a Create 3 does, and
diff_drive_controller by default."""

ENDLESS_S = 1.0
"""A base that goes on for longer does so by itself: one that hears nothing stops after
``HELD_S``."""

SLOWEST, STANDING = Command(0.03, 0.08), Command(0.015, 0.04)
"""Slower commands are not judged, and slower bases stand: m/s, rad/s."""

HALTED = 2
"""Odometry samples in a row that show a base which stands in the midst of a motion."""

RETRIED = 2
"""The motion after one that was not obeyed sends nothing, so that what moves then is late; the next
one tries again, none after it: what is queued stays shorter than one MoveAhead, which was free when
it was decided on."""

REMEMBERED_S = 15.0
"""A base that moves so long after a command that it did not obey may obey it now."""


class Lag:
    """Follows what was sent and what the base does."""

    def __init__(self, most: float) -> None:
        """Allow commands to come ``most`` seconds late; 0 is any time."""
        self.motions = 0
        """How many in a row began or ended late, the newest included."""
        self._limit, self._off = most, most == 0
        self._asked = self._sent = STOP
        self._begun = 0.0
        self._paused = self._halted = self._was_late = self._doubted = False
        self._halts, self._tries = 0, 0
        self._moved_at, self._stood_at = 0.0, 0.0
        self._unobeyed: float | None = None
        self._stood_until: float | None = None
        self._stopping: tuple[float, Command] | None = None
        self._goes_on_at = 0.0
        self._stamp = float("-inf")

    def told(self, t: float, asked: Command) -> Command:
        """What is sent at node time t for a velocity that is asked for, seconds.

        Returns:
            Zero in place of it while the base has not done yet what it was told.
        """
        begins = _moves(asked) and not _moves(self._asked)
        if begins:
            self._tries = 0 if self._unobeyed is None else self._tries + 1
            self.motions, self._was_late = self.motions * self._was_late, False
        if (begins or (self._paused and _moves(asked))) and self._tries in (0, RETRIED):
            self._begun, self._stood_until = t, None
            self._halted, self._halts = False, 0
        self._asked, self._paused = asked, False
        sent, before = STOP if self._waits() else asked, self._sent
        self._sent = sent
        if _moves(sent):
            self._stopping = None
            self._unobeyed = t if begins and self._unobeyed is None else self._unobeyed
        elif _moves(before):
            self._stop(t, before)
        return sent

    def pause(self, t: float) -> None:
        """Zero is sent at node time t, seconds, in the midst of a motion that goes on later."""
        if _moves(self._sent):
            self._stop(t, self._sent)
        self._sent, self._paused = STOP, True

    def silence(self, t: float) -> float:
        """For how long the base has not obeyed at node time t, seconds; 0 when it has."""
        return 0.0 if self._off or self._unobeyed is None else max(t - self._unobeyed, 0.0)

    def late(self, sample: Odometry) -> float:
        """Take the newest odometry.

        Returns:
            By how much a command came too late, seconds; 0 while there is nothing to complain of.
        """
        if self._off or sample.stamp <= self._stamp:
            return 0.0
        self._stamp = sample.stamp
        late = self._began_late(sample) or self._stopped_late(sample)
        if late <= self._limit:
            return 0.0
        self.motions += not self._was_late
        self._was_late = True
        return late

    def _stop(self, t: float, before: Command) -> None:
        self._stopping, self._goes_on_at = (t, before), t

    def _waits(self) -> bool:
        """Whether the newest odometry shows a base that has not done yet what it was told."""
        if self._off or self._unobeyed is None:
            return False
        stood_until = self._stamp if self._stood_until is None else self._stood_until
        late = stood_until - self._begun > self._limit
        return late or self._halted or self._tries not in (0, RETRIED)

    def _began_late(self, sample: Odometry) -> float:
        moves = _moves(Command(sample.v, sample.w), STANDING)
        stood_at = self._stood_at
        if not moves:
            self._stood_at = sample.stamp
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
            self._stood_until = None
            return 0.0
        if self._stood_until is None:  # one sample may be noise
            self._stood_until = stood_at
            return 0.0
        late = self._stood_until - since
        in_time = self._stood_until - self._begun <= self._limit
        # What came before was lost, it seems; or it is obeyed now, and what is newer comes later.
        self._doubted = in_time and since < self._begun
        self._obeyed()
        return 0.0 if in_time else late

    def _watch_halt(self, stamp: float, moves: bool) -> None:
        """A base that obeyed stands in the midst of a motion: it hears nothing, or only later."""
        if moves:
            self._moved_at = stamp
        self._halts = 0 if moves or not _moves(self._sent) else self._halts + 1
        if self._halts >= HALTED and stamp - self._begun > self._limit:
            self._unobeyed, self._halted = max(self._moved_at - HELD_S, self._begun), True

    def _obeyed(self) -> None:
        self._unobeyed, self._tries, self._stood_until = None, 0, None

    def _stopped_late(self, sample: Odometry) -> float:
        if self._stopping is None:
            return 0.0
        t, told = self._stopping
        goes_on = sample.v * told.v > STANDING.v * abs(told.v) or (
            sample.w * told.w > STANDING.w * abs(told.w)
        )
        if sample.stamp > t and goes_on:
            self._goes_on_at = sample.stamp
        late = self._goes_on_at - t - _braking(told)
        if sample.stamp <= t or goes_on or (self._doubted and late <= self._limit):
            return 0.0
        self._stopping = None
        return late if late < ENDLESS_S or self._doubted else 0.0


def _moves(velocity: Command, least: Command = SLOWEST) -> bool:
    return abs(velocity.v) >= least.v or abs(velocity.w) >= least.w


def _braking(told: Command) -> float:
    """Seconds until a base that is told to stand in time does."""
    forward, turning = abs(told.v) - STANDING.v, abs(told.w) - STANDING.w
    return max(forward / BRAKES.v, turning / BRAKES.w, 0.0)
