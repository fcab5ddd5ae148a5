"""How far a robot drove in one drive, by poses whose noise is no way, beside its twist. Pure.

Noise adds to every step between two samples, so that a base that stands seems to drive. Here a step
counts from where it is longer than noise makes it: poses are averaged over blocks that the noise
asks for (``odometry``), and between them the way is made of strides. All blocks are followed at
once, as the noise of a bag is known only later. Odometry without noise to speak of has the way of
its single steps.
"""

from __future__ import annotations

import math

from cfnav_ros.bags.files.events import Pose
from cfnav_ros.bags.judge.odometry import BLOCKS_S, TOO_FEW, Blocks, OdometryQuality
from cfnav_ros.drive.motion import Odometry
from cfnav_ros.drive.track import MIN_DT_S, STILL_V, Track, jumped

STRIDE_V = 0.05
"""m/s over a block. The stride is then nearly six standard deviations of the noise that the block
is for: two means of a base that stands differ by more once in 3,000 times."""

END_SIGMAS = 4.0
"""Of a single sample from a mean: one in 3,000 of a base that stands is farther."""

STEP_SIGMAS = math.sqrt(math.pi)
"""Mean length of the step between two poses of a base that stands, by the standard deviation of
each along one axis: that of a Rayleigh distribution, ``sqrt(pi / 2)``, with twice the variance."""

SAME_M, SAME_SHARE = 0.02, 0.02
"""Strides and single steps make the same way, metres and share of it; noise that could not add more
than this to the steps does not matter either."""

AGREE_M, AGREE_SHARE = 0.1, 0.1
"""Pose and twist agree, metres and share of the longer way: wheels slip by a few per cent, and the
twist between two samples is a guess."""

SLOW_S = 0.4
"""Odometry that comes more rarely may leave out a curve: a turn of 45 degrees takes 1.3 s."""

RETURNS, RETURNS_SHARE = 3, 0.05
"""So often, and in such a share of samples, the pose jumps back to where another source is."""

TWO_SOURCES = (
    "two odometries speak in turn on one topic: record each on its own, and name the one that "
    "counts with --topic odom:=NAME"
)


class Strides:
    """The way between means over blocks, in strides."""

    def __init__(self, block_s: float) -> None:
        """Begin; ``block_s``: of a block, seconds, 0 for each sample by itself."""
        self._block_s = block_s
        self._blocks = Blocks(block_s)
        self._before = 0.0  # metres until the last jump
        self._first: Pose | None = None
        self._first_piece = 0.0  # metres from the first sample to the first mean
        self._begin()

    def _begin(self) -> None:
        self._total = 0.0
        self._anchor: Pose | None = None
        self._mean: tuple[int, Pose] | None = None
        self._last: Pose | None = None

    def restart(self) -> None:
        """The pose jumped: the leap is no way."""
        self._before = self._strides
        self._blocks.restart()
        self._begin()

    def take(self, t_ns: int, pose: Pose) -> None:
        """Take the next sample."""
        self._last = pose
        self._first = self._first or pose
        mean = self._blocks.take(t_ns, pose) if self._block_s else (t_ns, pose)
        if mean is None:
            return
        before, self._mean = self._mean, mean
        if self._anchor is None or before is None:
            self._anchor = mean[1]
            if not self._before:
                self._first_piece = _apart(self._first, mean[1])
        elif _apart(self._anchor, mean[1]) >= STRIDE_V * max(_between(before, mean), MIN_DT_S):
            self._total += _apart(self._anchor, mean[1])
            self._anchor = mean[1]

    @property
    def _strides(self) -> float:
        """Metres between the means."""
        way = self._before + self._total
        return way + _apart(self._anchor, self._mean[1]) if self._anchor and self._mean else way

    def length(self, jitter_m: float) -> float:
        """Metres so far: between the means, and to both ends what is more than noise."""
        last_piece = _apart(self._mean[1], self._last) if self._mean and self._last else 0.0
        ends = (self._first_piece, last_piece)
        return self._strides + sum(piece for piece in ends if piece > END_SIGMAS * jitter_m)


class Way:
    """Follows the odometry of one drive.

    Attributes:
        jumps: how often the pose leapt further than a base can drive.
    """

    def __init__(self) -> None:
        self.jumps = 0
        self._samples = 0
        self._returns = 0  # samples that seem to be of another source
        self._track = Track()
        self._strides = {block: Strides(block) for block in (0.0, *BLOCKS_S)}
        self._by_twist = 0.0
        self._last: Odometry | None = None
        self._left: Odometry | None = None

    def take(self, t_ns: int, pose: Pose) -> None:
        """Take the next sample."""
        sample = Odometry(t_ns * 1e-9, pose.x, pose.y, pose.yaw, pose.v, pose.w)
        before, self._last = self._last, sample
        self._samples += 1
        if before is not None and sample.stamp <= before.stamp:
            self._returns += sample != before
        if before is not None and sample.stamp == before.stamp:
            return
        if not self._track.odometry(sample):
            self.jumps += 1
            self._returns += self._left is not None and not jumped(self._left, sample)
            self._left = before
            for strides in self._strides.values():
                strides.restart()
        elif before is not None:
            moving = [abs(o.v) if abs(o.v) >= STILL_V else 0.0 for o in (before, sample)]
            self._by_twist += sum(moving) / 2 * max(sample.stamp - before.stamp, 0.0)
        for strides in self._strides.values():
            strides.take(t_ns, pose)

    def of_two_sources(self, quality: OdometryQuality) -> bool:
        """Whether two odometries speak in turn, by jumps there and back, stamps or poses."""
        return quality.alternates or self._returns >= max(RETURNS, RETURNS_SHARE * self._samples)

    def length(self, quality: OdometryQuality) -> tuple[float | None, str]:
        """The way.

        Args:
            quality: of the bag's odometry.

        Returns:
            Metres, None when they cannot be told, and what to bear in mind of them or why they
            cannot; part of a sentence, empty when there is nothing.
        """
        if not self._samples:
            return None, "the drive holds no odometry"
        if self.of_two_sources(quality):
            return None, TWO_SOURCES
        steps, about = self._track.path_length, []
        block = BLOCKS_S[-1] if quality.block_s is None else quality.block_s
        metres = self._strides[block].length(quality.jitter_m)
        same = max(SAME_M, SAME_SHARE * steps)
        by_noise = STEP_SIGMAS * quality.jitter_m * self._samples
        if abs(metres - steps) <= same or (by_noise <= same and not quality.in_doubt):
            metres = steps
        elif quality.in_doubt:
            return None, TOO_FEW
        else:
            about.append(
                f"the odometry jitters by {1000 * quality.jitter_m:.1f} mm, so the way is counted "
                f"in strides ({steps:.2f} m by its single steps)"
            )
        if abs(metres - self._by_twist) > max(AGREE_M, AGREE_SHARE * max(metres, self._by_twist)):
            about.append(
                f"its poses say {metres:.2f} m, its twist says {self._by_twist:.2f} m: the poses "
                "count"
            )
        if quality.period > SLOW_S:
            about.append(
                f"odometry comes every {quality.period:.1f} s, and curves between are cut short"
            )
        return metres, "; ".join(about)


def _between(before: tuple[int, Pose], after: tuple[int, Pose]) -> float:
    """Seconds between two means."""
    return (after[0] - before[0]) * 1e-9


def _apart(a: Pose, b: Pose) -> float:
    return math.hypot(b.x - a.x, b.y - a.y)
