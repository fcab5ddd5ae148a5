"""How good the odometry of a bag is, and its means over short times. Pure.

Noise model: a pose is the true one plus an error that is drawn anew for each sample, of one spread
all through the bag. Errors that add up, such as slip and drift, are motion to whoever reads poses.
Both are told apart by how the residual of a pose between two others grows with the time between
them: that of drawn errors does not, that of slip doubles its variance, that of acceleration makes
it sixteen times as large.
"""

from __future__ import annotations

import math
import statistics
from collections import Counter, deque

from cfnav_ros.bags.files.events import Pose
from cfnav_ros.drive.motion import wrap
from cfnav_ros.drive.track import DRIFT_V, DRIFT_W, MIN_DT_S

BLOCKS_S = (0.075, 0.15, 0.3, 0.6)
"""Times over which odometry may be averaged, seconds: a stall of a second still holds three blocks
of the third. The last tells of longer ones only."""

SIGMAS = 3.25
"""Of the difference between two poses of a base that stands: one in 200 is larger."""

INTERVALS = 101
"""Intervals between samples whose median counts, so that pauses do not."""

FINEST_M = 1e-6
"""Smaller residuals are rounding."""

SHARES = 16
"""Classes of residuals to a factor of two: 4 % wide."""

ROUNDING_NS = 1000
"""Of stamps, nanoseconds."""

ALTERNATE = 9.0
"""Residuals beside neighbours are so many times larger, as variance, than beside those after them:
the samples come from two sources in turn."""

ALTERNATE_M = 0.002
"""Smaller steps, metres, are no sign of two sources."""

FEW = 30
"""Fewer residuals tell neither jitter from motion nor of a second source."""

TOO_FEW = "too few poses of the moving base tell noise of the odometry from motion"
"""Said where it matters."""

GROWN_BY_CHANCE = 2.0
"""Of the share to which a spread is known: so much do residuals seem to grow without growing."""


class _Spread:
    """The median of many positive numbers, to 4 %, in bounded memory."""

    def __init__(self) -> None:
        self.count = 0
        self._classes: Counter[int] = Counter()

    def take(self, value: float) -> None:
        self.count += 1
        self._classes[math.floor(SHARES * math.log2(max(value, FINEST_M)))] += 1

    def median(self) -> float:
        """Zero when there is none, or nothing but rounding."""
        left = self.count / 2
        for number in sorted(self._classes):
            left -= self._classes[number]
            if left <= 0:
                found = 2.0 ** ((number + 0.5) / SHARES)
                return found if found > 2 * FINEST_M else 0.0
        return 0.0


class Jitter:
    """The spread of the errors of samples; times in seconds, values in one unit."""

    def __init__(self, dimensions: int) -> None:
        """Know nothing yet; ``dimensions`` of a value, 1 or 2."""
        # of the length of a vector of normal numbers with standard deviation 1
        self._normal_median = 0.6745 if dimensions == 1 else 1.1774
        self._samples: deque[tuple[float, float, float]] = deque(maxlen=5)
        self._near, self._far = _Spread(), _Spread()

    def restart(self) -> None:
        """What comes does not go on from what was."""
        self._samples.clear()

    def take(self, t: float, a: float, b: float = 0.0) -> None:
        """Take the next sample, later than the one before."""
        samples = self._samples
        samples.append((t, a, b))
        for spread, apart in ((self._near, 1), (self._far, 2)):
            if len(samples) > 2 * apart:
                three = samples[-1 - 2 * apart], samples[-1 - apart], samples[-1]
                if not three[0][1:] == three[1][1:] == three[2][1:]:  # repeats tell of no error
                    spread.take(_residual(*three))

    @property
    def sigma(self) -> float:
        """Standard deviation along one axis."""
        near, far = self._variances
        if near == 0.0:
            return 0.0
        grown = far / near / (1.0 + GROWN_BY_CHANCE * self._doubt)
        return math.sqrt(near * min(max(2.0 * (2.0 - grown), 0.0), 1.0))

    @property
    def sigma_at_most(self) -> float:
        """What it hardly exceeds."""
        return self.sigma * (1.0 + self._doubt)

    @property
    def few(self) -> bool:
        """Whether there are too few residuals to tell jitter from motion."""
        return self._near.count < FEW

    @property
    def residual(self) -> float:
        """The standard deviation if all of the residuals were jitter."""
        return math.sqrt(self._variances[0])

    @property
    def _doubt(self) -> float:
        """Share to which the residuals tell a spread."""
        return 1.0 / math.sqrt(max(self._near.count, 1))

    @property
    def alternates(self) -> bool:
        """Whether samples come from two sources in turn, by values in metres."""
        near, far = self._variances
        enough = not self.few and math.sqrt(near) >= ALTERNATE_M
        return enough and near > ALTERNATE * far

    @property
    def _variances(self) -> tuple[float, float]:
        near, far = (s.median() / self._normal_median for s in (self._near, self._far))
        return near**2, far**2


def _residual(before: tuple[float, ...], at: tuple[float, ...], after: tuple[float, ...]) -> float:
    """How far a sample lies from the line between two others, as standard deviations of one."""
    share = (at[0] - before[0]) / (after[0] - before[0])
    off = [m - b * (1 - share) - a * share for b, m, a in zip(before, at, after, strict=True)][1:]
    return math.hypot(*off) / math.sqrt(1 + share**2 + (1 - share) ** 2)


class OdometryQuality:
    """Follows the odometry of a bag; times in nanoseconds, of one clock."""

    def __init__(self) -> None:
        self._place, self._heading = Jitter(2), Jitter(1)
        self._intervals: deque[float] = deque(maxlen=INTERVALS)
        self._last: tuple[int, Pose] | None = None
        self._yaw = 0.0

    def take(self, t_ns: int, pose: Pose) -> None:
        """Take the next sample; repeats do no harm."""
        before, self._last = self._last, (t_ns, pose)
        dt = 0.0 if before is None else (t_ns - before[0]) * 1e-9
        if before is None or dt < 0.0:
            self._place.restart()
            self._heading.restart()
            self._yaw = pose.yaw
        elif dt == 0.0:
            return
        else:
            self._intervals.append(dt)
            self._yaw += wrap(pose.yaw - before[1].yaw)
        self._place.take(t_ns * 1e-9, pose.x, pose.y)
        self._heading.take(t_ns * 1e-9, self._yaw)

    @property
    def period(self) -> float:
        """Usual time between two samples, seconds; 0 when there are not two."""
        return statistics.median_low(self._intervals) if self._intervals else 0.0

    @property
    def jitter_m(self) -> float:
        """Standard deviation of the place along one axis, metres."""
        return self._place.sigma

    @property
    def jitter_rad(self) -> float:
        """Standard deviation of the heading, radians."""
        return self._heading.sigma

    @property
    def alternates(self) -> bool:
        """Whether its poses are those of two sources in turn."""
        return self._place.alternates

    @property
    def block_s(self) -> float | None:
        """Shortest time to average over by which a base that stands is told from one that moves.

        That is by ``DRIFT_V`` and ``DRIFT_W`` between one block and the next.

        Returns:
            One of ``BLOCKS_S``; 0 where each sample will do, None where no block would.
        """
        return self._block(self._place.sigma_at_most, self._heading.sigma_at_most)

    @property
    def spacing(self) -> float:
        """Time between two poses that can be compared, seconds; infinite where none can."""
        return self._spacing(self.block_s)

    @property
    def longest_spacing(self) -> float:
        """The same if all that few samples tell is jitter, else ``spacing``."""
        place, heading = (
            jitter.residual if jitter.few else jitter.sigma_at_most
            for jitter in (self._place, self._heading)
        )
        return max(self._spacing(self._block(place, heading)), self.spacing)

    @property
    def in_doubt(self) -> bool:
        """Whether too few samples tell jitter from motion, and it matters."""
        return self.longest_spacing > self.spacing

    def _block(self, place: float, heading: float) -> float | None:
        """``block_s`` for standard deviations of place (m) and heading (rad)."""
        slower = max(place / DRIFT_V, heading / DRIFT_W)
        apart = SIGMAS * math.sqrt(2.0) * slower  # seconds between two samples that suffice
        if apart <= max(self.period, MIN_DT_S):
            return 0.0
        needed = (apart * math.sqrt(self.period)) ** (2 / 3)  # n = block / period, spread / sqrt(n)
        return next((block for block in BLOCKS_S if block >= needed), None)

    def _spacing(self, block: float | None) -> float:
        if block is None:
            return math.inf
        return math.ceil(block / self.period - 1e-6) * self.period if block else self.period


class Blocks:
    """Means of the odometry over blocks of time."""

    def __init__(self, block_s: float) -> None:
        """Begin; ``block_s``: how long a block lasts, seconds."""
        self._block_ns = round(block_s * 1e9) - ROUNDING_NS
        self._count = self._first_ns = self._last_ns = 0
        self._first: Pose | None = None
        self._sums = (0, 0.0, 0.0, 0.0, 0.0, 0.0)

    def restart(self) -> None:
        """What comes does not go on from what was: the block under way is dropped."""
        self._count, self._first = 0, None

    def take(self, t_ns: int, pose: Pose) -> tuple[int, Pose] | None:
        """Take the next sample; repeats do no harm.

        Returns:
            The block that is complete with it, as its mean time in nanoseconds and mean pose.
        """
        if self._count and t_ns <= self._last_ns:
            if t_ns == self._last_ns:
                return None
            self.restart()
        mean = None
        if self._count and t_ns - self._first_ns >= self._block_ns:
            mean = self._mean()
            self.restart()
        if self._first is None:
            self._first_ns, self._first = t_ns, pose
            self._sums = (0, 0.0, 0.0, 0.0, 0.0, 0.0)
        t, x, y, yaw, v, w = self._sums
        self._sums = (
            t + t_ns - self._first_ns,
            x + pose.x,
            y + pose.y,
            yaw + wrap(pose.yaw - self._first.yaw),
            v + pose.v,
            w + pose.w,
        )
        self._count += 1
        self._last_ns = t_ns
        return mean

    def _mean(self) -> tuple[int, Pose]:
        n, first = self._count, self._first
        assert first is not None
        t, x, y, yaw, v, w = self._sums
        at_ns = self._first_ns + t // n
        mean_yaw = wrap(first.yaw + yaw / n)
        return at_ns, Pose(t_ns=at_ns, x=x / n, y=y / n, yaw=mean_yaw, v=v / n, w=w / n)


class OneOdometry:
    """Keeps to one source of a topic: two would make a zigzag.

    Sources are told apart by their frames here; without them by their jumps (``way``).
    """

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()

    def takes(self, pose: Pose) -> bool:
        """Whether a sample is of the source that spoke first."""
        self._counts[pose.frames] += 1
        return pose.frames == next(iter(self._counts))

    @property
    def notes(self) -> list[str]:
        """One sentence when there are several."""
        if len(self._counts) < 2:
            return []
        names = ", ".join(f"{name} ({count} messages)" for name, count in self._counts.items())
        first = next(iter(self._counts))
        return [f"Several odometries speak on one topic: {names}; {first} spoke first and counts."]
