"""What is judged right by which odometry: ``python -m studies.bags.odometry_figures``.

Drives made by code, whose way and touches are known, are written as bags and judged. A base is told
to drive 1.2 m at 0.2 m/s; in half of the drives a wall stops it after 0.6 m, and it is told to go
on. Varied are the rate of the odometry and its noise, the rate of the commands and whether the base
forgets them, and who speaks on the topic. Each drive is made again with other noise. Prints a
Markdown table.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from cfnav_ros.bags.evaluation import JudgeOptions, evaluate
from cfnav_ros.bags.judge.outcomes import DriveOutcome
from tqdm import tqdm

from cfnav_core.command import run_options
from studies.bags.bag_files import ZERO_NS, Message, S, odometry, twist, write_mcap
from studies.bags.bag_files import command as velocity_command
from studies.engine.pages import table

SPEED, ACCELERATION = 0.2, 0.9
"""m/s and m/s^2 of the base."""

BEGIN_S, DRIVE_S, END_S = 1.0, 6.0, 9.0
"""When it is told to go, how long, and when the bag ends."""

WALL_M = 0.6
"""Where the wall stands."""

STEP_S = 0.001
"""Of the base's motion."""

HOLDS = math.inf
"""A base that goes on until the next command."""

FORGETS = 0.5
"""s; a Create 3 forgets its command after so long."""

ONE, FRAMES = "one source", "two sources with frames of their own"
FAR, NEAR = "two sources 0.5 m apart", "two sources 3 cm apart"
"""Who speaks on the topic."""


@dataclass(frozen=True)
class Setting:
    """How a drive is recorded.

    Attributes:
        odometry_hz: rate of the odometry. noise_m: standard deviation of its place along one axis,
        metres. noise_rad: of its heading, radians. command_hz: rate of the commands. memory_s: how
        long the base heeds one, seconds. sources: who speaks. wall: whether there is one.
    """

    odometry_hz: float = 20.0
    noise_m: float = 0.0
    noise_rad: float = 0.0
    command_hz: float = 20.0
    memory_s: float = HOLDS
    sources: str = ONE
    wall: bool = False


SETTINGS = (
    *(Setting(odometry_hz=hz) for hz in (1, 2, 3, 5, 10, 20, 50, 100, 200)),
    *(
        Setting(odometry_hz=hz, noise_m=mm / 1000)
        for hz in (2, 5, 10, 20, 50, 100, 200)
        for mm in (1, 2, 5, 10)
    ),
    *(Setting(noise_rad=math.radians(degrees)) for degrees in (0.2, 0.5, 1.0, 2.0)),
    *(Setting(command_hz=hz) for hz in (0.5, 1, 2, 5, 10, 50)),
    *(Setting(command_hz=hz, memory_s=FORGETS) for hz in (0.5, 1, 1.5, 2, 5)),
    *(Setting(sources=sources) for sources in (FRAMES, FAR, NEAR)),
)
"""Each is driven with a wall and without."""


@dataclass(frozen=True)
class OdometryFiguresConfig:
    """Judge drives whose way and touches are known."""

    seeds: int = 5
    """Drives of each setting."""


@dataclass(frozen=True)
class Figure:
    """What was found in the drives of one setting.

    Attributes:
        setting: of the drives.
        errors: of the paths, metres, those that were told.
        touches: that were found, None where it is unknown.
    """

    setting: Setting
    errors: tuple[float, ...]
    touches: tuple[int | None, ...]

    @property
    def worst_m(self) -> float | None:
        """The largest error either way, None when no path was told."""
        return max(map(abs, self.errors), default=None)


def motion(setting: Setting) -> np.ndarray:
    """How the base moves.

    Returns:
        Float64 [N, 2]: place (m) and speed (m/s) at each ``STEP_S``.
    """
    place = speed = 0.0
    rows = []
    period = 1 / setting.command_hz
    for step in range(round(END_S / STEP_S) + 1):
        t = step * STEP_S
        rows.append((place, speed))
        age = (t + 1e-9) % period
        told = BEGIN_S <= t - age < BEGIN_S + DRIVE_S and age <= setting.memory_s
        change = told * SPEED - speed
        speed += math.copysign(min(ACCELERATION * STEP_S, abs(change)), change)
        if setting.wall and place + speed * STEP_S > WALL_M:
            place, speed = WALL_M, 0.0
        place += speed * STEP_S
    return np.array(rows)


def messages(setting: Setting, driven: np.ndarray, seed: int) -> list[Message]:
    """What was recorded of a motion."""
    said = list(_commands(setting))
    rng, second = np.random.default_rng(seed), setting.sources != ONE
    said += _odometry(setting, driven, rng, 0.0, 0.0, "odom")
    if second:
        apart = {FRAMES: 0.5, FAR: 0.5, NEAR: 0.03}[setting.sources]
        frame = "visual_odom" if setting.sources == FRAMES else "odom"
        said += _odometry(setting, driven, rng, 0.5 / setting.odometry_hz, apart, frame)
    return sorted(said, key=lambda message: message.log_ns)


def _commands(setting: Setting) -> Iterator[Message]:
    for number in range(math.ceil(END_S * setting.command_hz)):
        t = number / setting.command_hz
        v = SPEED if BEGIN_S <= t + 1e-9 < BEGIN_S + DRIVE_S else 0.0
        yield _message("/cmd_vel", t, velocity_command(_ns(t), v))


def _odometry(
    setting: Setting,
    driven: np.ndarray,
    rng: np.random.Generator,
    late_s: float,
    aside_m: float,
    frame: str,
) -> Iterator[Message]:
    for number in range(math.ceil(END_S * setting.odometry_hz)):
        t = number / setting.odometry_hz + late_s
        place, speed = driven[min(round(t / STEP_S), len(driven) - 1)]
        x, y = rng.normal((place, aside_m), setting.noise_m)
        message = odometry(_ns(t), x, rng.normal(0.0, setting.noise_rad), speed)
        message.pose.pose.position.y = y
        message.twist.twist = twist(speed, 0.0)
        message.header.frame_id = frame
        yield _message("/odom", t, message)


def _ns(t: float) -> int:
    return ZERO_NS + round(t * S)


def _message(topic: str, t: float, message: Any) -> Message:
    return Message(topic, message.__msgtype__, _ns(t), message)


def judged(setting: Setting, seed: int, folder: Path) -> tuple[DriveOutcome, float]:
    """Write a drive as a bag into a folder and judge it.

    Returns:
        Its outcome, and the way that it truly drove, metres.
    """
    driven = motion(setting)
    path = write_mcap(folder / "drive.mcap", messages(setting, driven, seed))
    (drive,) = evaluate(path, JudgeOptions()).drives
    return drive.outcome, float(driven[-1, 0])


def figure(setting: Setting, seeds: int) -> Figure:
    """Judge the drives of a setting."""
    errors, touches = [], []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(seeds):
            outcome, true_m = judged(setting, seed, Path(folder))
            touches.append(outcome.collisions.value)
            if outcome.path_length_m.known:
                errors.append(outcome.path_length_m.value - true_m)
    return Figure(setting, tuple(errors), tuple(touches))


def report(pairs: Sequence[tuple[Figure, Figure]]) -> str:
    """The table: a row a setting, of a drive without and one with a wall."""
    columns = {
        "odometry": lambda pair: _odometry_words(pair[0].setting),
        "commands": lambda pair: _commands_words(pair[0].setting),
        "free: worst error of the path, mm": lambda pair: _error(pair[0]),
        "touches (0)": lambda pair: _touches(pair[0]),
        "wall: worst error of the path, mm": lambda pair: _error(pair[1]),
        "touches (1)": lambda pair: _touches(pair[1]),
    }
    return table(columns, pairs)


def _odometry_words(setting: Setting) -> str:
    words = [f"{setting.odometry_hz:g} Hz"]
    if setting.noise_m:
        words.append(f"{1000 * setting.noise_m:g} mm")
    if setting.noise_rad:
        words.append(f"{math.degrees(setting.noise_rad):g}°")
    return ", ".join([*words, *[setting.sources] * (setting.sources != ONE)])


def _commands_words(setting: Setting) -> str:
    forgets = "" if math.isinf(setting.memory_s) else f", forgotten after {setting.memory_s:g} s"
    return f"{setting.command_hz:g} Hz{forgets}"


def _error(figure: Figure) -> str:
    worst = figure.worst_m
    return "unknown" if worst is None else f"{1000 * worst:.0f}"


def _touches(figure: Figure) -> str:
    """What was found in how many of the drives, the most frequent first."""
    kinds = sorted(set(figure.touches), key=lambda found: -figure.touches.count(found))
    words = ["unknown" if kind is None else str(kind) for kind in kinds]
    if len(words) == 1:
        return words[0]
    counts = (figure.touches.count(kind) for kind in kinds)
    return ", ".join(f"{word} ({n})" for word, n in zip(words, counts, strict=True))


def main(config: OdometryFiguresConfig) -> None:
    """Judge and print."""
    pairs = [
        (figure(setting, config.seeds), figure(replace(setting, wall=True), config.seeds))
        for setting in tqdm(SETTINGS)
    ]
    print(report(pairs))


if __name__ == "__main__":
    sys.exit(run_options("odometry_figures", OdometryFiguresConfig, main))
