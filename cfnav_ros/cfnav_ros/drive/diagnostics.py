"""What ``/diagnostics`` says of the policy node. Pure: levels, sentences and values are results."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

import numpy as np

from cfnav_core.detect.sightings import Sighting
from cfnav_ros.drive.episode import Episode
from cfnav_ros.drive.inputs import (
    DETECTIONS,
    AgeLimits,
    CameraFrame,
    SensorInputs,
    input_complaint,
    name_of,
    needed,
)
from cfnav_ros.drive.watch import forbids
from cfnav_ros.robot.stamps import NEVER

RATE_WINDOW_S = 5.0
"""Real time over which rates are taken."""

INFERENCES = 500
"""Newest inferences whose times count."""

MOST_TOLD = 5
"""Things that a row tells of."""

GAP_S = 0.25
"""A larger gap between velocities is half of what makes a base stop by itself (0.5 s)."""


class Level(IntEnum):
    """As in diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2


STATUSES = {
    "hazards": Level.WARN, "wheel status": Level.OK, "dock status": Level.OK, "battery": Level.OK,
}  # fmt: skip
"""What a base may tell, and how bad it is not to hear it: without hazards no bump is known of."""


@dataclass(frozen=True)
class Report:
    """One row of ``/diagnostics``."""

    name: str
    level: Level = Level.OK
    message: str = ""
    values: Mapping[str, str] = field(default_factory=dict)


class Rate:
    """How often something happens."""

    def __init__(self) -> None:
        self._times: deque[float] = deque()

    def note(self, real: float) -> None:
        """It happened at a monotonic real time, seconds."""
        self._times.append(real)
        self._forget(real)

    def hz(self, real: float) -> float:
        """Times a second within the last ``RATE_WINDOW_S``."""
        self._forget(real)
        if len(self._times) < 2:
            return 0.0
        return (len(self._times) - 1) / (real - self._times[0])

    def _forget(self, real: float) -> None:
        while self._times and real - self._times[0] > RATE_WINDOW_S:
            self._times.popleft()


class Stopwatch:
    """Real times that calls take; they may be made in another thread."""

    def __init__(self) -> None:
        self._seconds: deque[float] = deque(maxlen=INFERENCES)

    def timed(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function, with every call's time noted."""

        def call(*args: Any) -> Any:
            begun = time.perf_counter()
            try:
                return function(*args)
            finally:
                self._seconds.append(time.perf_counter() - begun)

        return call

    def percentiles_ms(self) -> tuple[float, float]:
        """Median and 99th percentile, milliseconds; NaN before the first call."""
        if not self._seconds:
            return math.nan, math.nan
        p50, p99 = np.percentile(tuple(self._seconds), (50, 99)) * 1e3
        return float(p50), float(p99)


def input_reports(
    t: float,
    inputs: SensorInputs,
    limits: AgeLimits,
    rates: Mapping[str, float],
    lidar: bool = True,
    tilt: bool = True,
) -> Iterator[Report]:
    """One row for each input that is needed.

    Args:
        t: node time, seconds.
        inputs: newest messages.
        limits: oldest allowed.
        rates: messages a second, by field of ``SensorInputs``.
        lidar: whether the collision estimate is needed.
        tilt: whether the camera tilt is needed.
    """
    for name in needed(lidar, tilt):
        complaint = input_complaint(t, inputs, name, getattr(limits, name))
        if not complaint and name == "frame":
            complaint = inputs.picture.fault or inputs.picture.waiting
        stamp = inputs.stamps[name]
        values = {
            "age_s": "never" if stamp == NEVER else f"{t - stamp:.3f}",
            "rate_hz": f"{rates.get(name, 0.0):.1f}",
            "limit_s": f"{getattr(limits, name):g}",
        }
        if name == "frame" and inputs.view == DETECTIONS and not complaint:
            values |= _detected(inputs.frame)
        level = Level.ERROR if complaint else Level.OK
        yield Report(name_of(name, inputs), level, complaint or "arrives", values)


def _detected(frame: CameraFrame) -> dict[str, str]:
    """What a detector says, and what of it counts: a wrong label or score is seen here first."""
    seen: Sequence[Sighting] = frame.decode()
    surest = sorted(seen, key=lambda one: -one.confidence)[:MOST_TOLD]
    return {
        "boxes": str(len(frame.data or ())),
        "boxes_that_count": str(len(seen)),
        "surest": "; ".join(
            f"{one.name} {one.confidence:.2f}, {math.degrees(one.azimuth):.0f} deg to the right, "
            + (f"{one.distance:.1f} m" if one.distance else "nobody knows how far")
            for one in surest
        ),
    }


def status_reports(
    heard: Collection[str], unheard: Collection[str], quiet: Collection[str] = ()
) -> Iterator[Report]:
    """One row for each thing that this base may tell; an episode goes without.

    Args:
        heard: which of ``STATUSES`` have been heard.
        unheard: which of them nobody tells.
        quiet: which of them somebody would tell, and had no reason to yet.
    """
    for name, level in STATUSES.items():
        if name in heard:
            yield Report(name, message="heard")
        elif name in unheard:
            yield Report(name, level, "not heard")
        elif name in quiet:
            yield Report(name, message="nothing told yet")


def episode_report(episode: Episode | None) -> Report:
    """What the present episode is about; None between episodes."""
    if episode is None:
        return Report("episode", message="no goal")
    decision = episode.decision
    return Report(
        "episode",
        message=f"{episode.goal}: {episode.phase.value}",
        values={
            "goal": episode.goal,
            "phase": episode.phase.value,
            "steps": str(episode.steps),
            "vetoes": str(episode.vetoes),
            "bumps": str(episode.track.bumps),
            "pushes": str(episode.pushes),
            "path_length_m": f"{episode.track.path_length:.2f}",
            "last_action": decision.action.name if decision else "none",
            "collision_probability": f"{decision.collision_probability:.3f}" if decision else "",
        },
    )


def inference_report(p50_ms: float, p99_ms: float, limit_s: float) -> Report:
    """How long the policy takes; it is late from ``limit_s`` seconds on."""
    slow = p99_ms > 1e3 * limit_s
    return Report(
        "inference",
        Level.WARN if slow else Level.OK,
        f"slower than {limit_s:g} s" if slow else "",
        {"p50_ms": f"{p50_ms:.1f}", "p99_ms": f"{p99_ms:.1f}"},
    )


def base_report(
    inputs: SensorInputs,
    topic: str,
    kind: str,
    gap_s: float,
    driving: bool,
    undocks: bool = False,
) -> Report:
    """Who is driven, and how steadily.

    Args:
        inputs: newest messages.
        topic: resolved name of the velocity topic.
        kind: message type sent there, empty when none.
        gap_s: largest real time between two velocities of the episode, seconds.
        driving: whether a goal is served; only then has anybody looked for a base.
        undocks: whether a base on its dock leaves it for a goal.
    """
    complaint = forbids(replace(inputs, docked=inputs.docked and not undocks)) or (
        inputs.base.waiting if driving else ""
    )
    level = Level.ERROR if complaint else Level.WARN if gap_s > GAP_S else Level.OK
    return Report(
        "base",
        level,
        complaint or (f"{gap_s:.2f} s passed between two velocities" if gap_s > GAP_S else ""),
        {
            "topic": topic,
            "type": kind or "none",
            "largest_gap_s": f"{gap_s:.3f}",
            "docked": str(inputs.docked).lower(),
            "powered": str(inputs.powered).lower(),
        },
    )
