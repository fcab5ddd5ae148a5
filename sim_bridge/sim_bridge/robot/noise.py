"""What a real robot's sensors and wheels add to the truth, drawn from a seed.

Pure numpy. With every magnitude zero each function returns its argument as it was; depth keeps the
limits of a stereo camera.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from sim_bridge.robot import stereo


@dataclass(frozen=True)
class NoiseLevels:
    """Every magnitude, nominal. "Assumed" ones have no source: measure them on the robot.

    Standard deviations of normal distributions unless said otherwise.
    """

    range_share: float = 0.003
    """Of the range. Three of them are the 1 % of the A1M8's data sheet."""
    range_resolution: float = 0.0005
    """m; ranges are multiples of it. Source: A1M8 data sheet, below 1.5 m."""
    dropout: float = 0.01
    """Share of beams without a return beside those that truly have none. Assumed."""
    edge_ghost: float = 0.02
    """Share of beams at a depth edge that measure a point between both sides: triangulation sees
    the edge from another place than the laser. Seen in GNSS-Stylist/GNSS-Stylus#7; share assumed.
    """
    forward_slip: float = 0.01
    """Of the forward speed, drawn for each motion. Assumed."""
    turn_slip: float = 0.01
    """Of the yaw rate, drawn for each motion. Assumed."""
    veer: float = 0.03
    """rad per m driven, drawn for each motion: wheels of unequal size or grip. Assumed; over one
    MoveAhead of 0.25 m this is 0.4 degrees."""
    odometry_scale: float = 0.005
    """Of the distance, one draw for a robot. Assumed: an optical floor sensor corrects the wheels
    (create3_docs ``odometry.md``)."""
    gyro_scale: float = 0.003
    """Of the angle, one draw for a robot. Assumed."""
    gyro_drift: float = math.radians(1.0) / 60.0
    """rad/s while the robot moves, one draw for a robot; at rest the base calibrates its gyroscope
    (create3_docs ``reflexes.md``, REFLEX_GYRO_CAL). Assumed: one degree a minute."""
    twist_share: float = 0.01
    """Of the velocities that the base reports. Assumed."""
    read_noise: float = 1.0
    """Grey levels. Assumed."""
    photon_noise: float = 0.03
    """Variance in grey levels per grey level. From 4500 electrons of a 1.55 um pixel (assumed for
    the IMX378), gain 8 and the mean over the 13 pixels of the 1080P frame in one of 300x300:
    255 / (4500 / 8) / 13 = 0.035."""
    exposure: float = 0.03
    """Share of the brightness by which automatic exposure wanders, see ``EXPOSURE_S``. Assumed."""
    exposure_time: float = 0.02
    """s that the shutter is open: motion blurs the picture. Assumed for a lit room."""
    image_latency: float = 0.05
    """s from exposure to message. Source: docs.luxonis.com, "Low Latency", 33 ms for 1080P over
    USB 3; the rest for conversion and middleware is assumed."""
    odometry_latency: float = 0.02
    """s from measurement to message, through the relay. Assumed."""
    disparity: float = 0.2
    """Native pixels. Source: docs.luxonis.com, OAK-D Pro, "Depth accuracy": below 2 % to 4 m, which
    at 400P is 0.17 pixels."""
    mismatch: float = 0.0005
    """Share of the patches that are matched with anything. Assumed: most fail the check from right
    to left."""
    plain: float = 0.5
    """Grey levels: a patch that varies no more returns no depth. Assumed for a camera without dot
    projector (OAK-D, OAK-D Lite); with it (OAK-D Pro) plain walls return depth, too: 0."""
    depth_latency: float = 0.1
    """s from exposure to message: matching at 400P takes 30 ms more than a picture. Assumed, with
    conversion and middleware."""

    def scaled(self, factor: float) -> NoiseLevels:
        """All magnitudes times a factor."""
        return NoiseLevels(**{f.name: factor * getattr(self, f.name) for f in fields(self)})


EXPOSURE_S = 5.0
"""s within which automatic exposure forgets where it was."""

DEPTH_EDGE_M = 0.3
"""Neighbouring ranges farther apart than this are a depth edge."""

_POOL = 1 << 21
"""Normal numbers drawn in advance: each picture takes a stretch of them from a drawn place, as
drawing 270,000 anew would cost more than rendering. A picture that needs more draws a larger
pool once."""


class Noise:
    """Draws the noise of one robot.

    Args:
        levels: magnitudes.
        seed: of everything drawn; each sense draws from a stream of its own.
    """

    def __init__(self, levels: NoiseLevels, seed: int) -> None:
        self.levels = levels
        self._lidar_is_exact = levels.range_share == levels.dropout == levels.edge_ghost == 0
        pictures = levels.read_noise > 0 or levels.photon_noise > 0
        self._pool = _normal(_POOL if pictures else 0)
        self.reseed(seed)

    def reseed(self, seed: int) -> None:
        """Begin all over: the same seed gives the same noise for the same motions."""
        streams = [np.random.default_rng([seed, 2, k]) for k in range(5)]
        self._beams, self._wheels, self._counts, self._pixels, self._matches = streams
        levels = self.levels
        self._odometry_scale = 1.0 + levels.odometry_scale * self._counts.standard_normal()
        self._gyro_scale = 1.0 + levels.gyro_scale * self._counts.standard_normal()
        self._gyro_drift = levels.gyro_drift * self._counts.standard_normal()
        self._exposure = self._pixels.standard_normal()
        self._slips = (0.0, 0.0, 0.0)
        self._moves = False

    def phase(self) -> float:
        """Share of a sample's time from the beginning of a turn to its first sample.

        Motor and laser keep no common time. Without noise it is always one half.
        """
        return 0.5 if self._lidar_is_exact else float(self._beams.random())

    def scan(self, distances: np.ndarray) -> np.ndarray:
        """What the LiDAR measures of a turn.

        Args:
            distances: float32 [N], true, metres by angle, inf where nothing returns.

        Returns:
            The same shape.
        """
        if self._lidar_is_exact:
            return distances
        levels, rng = self.levels, self._beams
        chance, place = rng.random((2, len(distances)), np.float32)
        spread = rng.standard_normal(len(distances), np.float32)
        other = np.roll(distances, 1)
        with np.errstate(invalid="ignore"):  # inf - inf
            edge = np.abs(distances - other) > DEPTH_EDGE_M
        ghost = edge & np.isfinite(distances) & np.isfinite(other) & (chance < levels.edge_ghost)
        measured = distances.copy()
        measured[ghost] += place[ghost] * (other[ghost] - distances[ghost])
        measured *= 1.0 + levels.range_share * spread
        if levels.range_resolution:
            measured = np.round(measured / levels.range_resolution) * levels.range_resolution
        measured[chance > 1.0 - levels.dropout] = np.inf
        return measured.astype(np.float32)

    def slip(self, v: float, w: float) -> tuple[float, float]:
        """How the robot truly moves when its wheels do this.

        Args:
            v: m/s forward, as the wheels turn.
            w: rad/s, as the wheels turn.

        Returns:
            True m/s and rad/s. What slips is drawn when a motion begins and holds until it ends.
        """
        moves = v != 0 or w != 0
        if moves and not self._moves:
            levels = self.levels
            forward, turn, veer = (float(value) for value in self._wheels.standard_normal(3))
            self._slips = (
                levels.forward_slip * forward,
                levels.turn_slip * turn,
                levels.veer * veer,
            )
        self._moves = moves
        forward, turn, veer = self._slips
        return v * (1.0 + forward), w * (1.0 + turn) + veer * v

    def count(
        self, forward: float, left: float, turn: float, dt: float
    ) -> tuple[float, float, float]:
        """What the base counts of a true motion: m forward, m left, rad; dt is its length in s."""
        drift = self._gyro_drift * dt if self._moves else 0.0
        scale = self._odometry_scale
        return scale * forward, scale * left, self._gyro_scale * turn + drift

    def twist(self, v: float, w: float) -> tuple[float, float]:
        """What the base reports of its true velocity: m/s, rad/s."""
        share = self.levels.twist_share
        a, b = (float(value) for value in self._counts.standard_normal(2))
        return v * (1.0 + share * a), w * (1.0 + share * b)

    def picture(
        self, rgb: np.ndarray, dt: float, moved: Sequence[float] = (0.0, 0.0)
    ) -> np.ndarray:
        """What the camera makes of a picture.

        Args:
            rgb: uint8 [H, W, 3], without noise.
            dt: s since the last picture.
            moved: pixels per s by which its middle moves to the right and down.

        Returns:
            uint8 [H, W, 3].
        """
        levels = self.levels
        right, down = (levels.exposure_time * speed for speed in moved)
        rgb = blurred(blurred(rgb, right, 1), down, 0)
        if levels.read_noise == levels.photon_noise == levels.exposure == 0:
            return rgb
        forget = math.exp(-dt / EXPOSURE_S)
        fresh = self._pixels.standard_normal()
        self._exposure = forget * self._exposure + math.sqrt(1 - forget**2) * fresh
        # Mean and spread depend on the grey level alone: computed 256 times, then looked up.
        mean = np.arange(256, dtype=np.float32) * np.float32(1 + levels.exposure * self._exposure)
        spread = np.sqrt(levels.read_noise**2 + levels.photon_noise * np.maximum(mean, 0))
        out = mean.take(rgb)
        if len(self._pool):
            out += spread.astype(np.float32).take(rgb) * self._grains(rgb.size).reshape(rgb.shape)
        return np.clip(np.rint(out, out=out), 0, 255, out=out).astype(np.uint8)

    def depth(self, depth: np.ndarray, rgb: np.ndarray) -> np.ndarray:
        """What the stereo camera measures: uint16 [H, W], mm; see ``stereo.measured``."""
        levels = self.levels
        return stereo.measured(
            depth, rgb, levels.disparity, levels.mismatch, levels.plain, self._matches
        )

    def _grains(self, size: int) -> np.ndarray:
        """float32 [size]: normal numbers from a drawn place of the pool."""
        if size >= len(self._pool):
            self._pool = _normal(2 * size)
        start = int(self._pixels.integers(len(self._pool) - size))
        return self._pool[start:][:size]


def _normal(count: int) -> np.ndarray:
    """float32 [count]: the same normal numbers each time."""
    return np.random.default_rng(0).standard_normal(count, np.float32)


def blurred(rgb: np.ndarray, pixels: float, axis: int) -> np.ndarray:
    """A picture smeared along one axis by the mean over whole shifts; its edges repeat.

    Args:
        rgb: uint8 [H, W, 3].
        pixels: length of the smear; below one nothing changes.
        axis: 0 down, 1 right.
    """
    count = min(round(abs(pixels)), rgb.shape[axis] // 2) + 1
    if count == 1:
        return rgb
    before = (count - 1) // 2
    width = [(0, 0)] * 3
    width[axis] = (before, count - 1 - before)
    padded = np.pad(rgb, width, mode="edge")
    size = rgb.shape[axis]
    total = np.zeros(rgb.shape, np.uint16)
    for shift in range(count):
        total += padded[:, shift : shift + size] if axis else padded[shift : shift + size]
    return (total // count).astype(np.uint8)
