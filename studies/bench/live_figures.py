"""What was heard of drives on the live graph -> rates, delays, losses. Pure.

Arrivals are times of a steady clock in the listening process; stamps are simulated time.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

NOMINAL_HZ = {"camera_hz": 15.0, "scan_hz": 7.7, "odom_hz": 20.0}
"""Rates of the robot's sensors."""

AIM_P99_MS = 200.0
"""Aim for the 99th percentile of the time from a picture to the decision on it."""


@dataclass(frozen=True)
class Heard:
    """One message; ``arrived`` in s of the steady clock, ``stamp_ns`` as the sender set it."""

    arrived: float
    stamp_ns: int


@dataclass(frozen=True)
class HeardDecision(Heard):
    """One decision of the policy and the stamp of the picture it was taken on."""

    image_ns: int


@dataclass(frozen=True)
class HeardEpisode:
    """One episode as another process heard it.

    Attributes:
        room: room of the drive.
        goal: what was sought.
        speed: simulated seconds per real second that were asked for; 0 is no limit.
        outcome: how the policy node says that it ended.
        message: its sentence about that.
        clock: messages on ``/clock``.
        sensors: messages of each sensor, by the names of ``NOMINAL_HZ``.
        decisions: all decisions of the episode.
    """

    room: str
    goal: str
    speed: float
    outcome: str
    message: str
    clock: tuple[Heard, ...]
    sensors: dict[str, tuple[Heard, ...]]
    decisions: tuple[HeardDecision, ...]

    @property
    def held(self) -> bool:
        """Whether the graph kept up, so that the drive ended as the policy wanted."""
        return self.outcome in ("done", "step_limit")


def stamp_ns(cdr: bytes) -> int:
    """Return the stamp of a serialised message that begins with a Time or a Header.

    Args:
        cdr: 4 bytes of encapsulation, then int32 seconds, uint32 nanoseconds.
    """
    seconds, nanoseconds = struct.unpack_from("<iI" if cdr[1] & 1 else ">iI", cdr, 4)
    return int(seconds) * 1_000_000_000 + int(nanoseconds)


def rate_hz(series: Iterable[Sequence[Heard]]) -> float:
    """Return how often messages arrived, over all drives; what lies between drives is left out.

    Raises:
        ValueError: no drive heard two messages.
    """
    pairs = [(len(s) - 1, s[-1].arrived - s[0].arrived) for s in series if len(s) > 1]
    if not pairs:
        raise ValueError("no drive was long enough to hear two messages of a sensor")
    return sum(n for n, _ in pairs) / sum(span for _, span in pairs)


def spans_s(drive: HeardEpisode) -> tuple[float, float]:
    """Return how long a drive took in simulated and in real seconds, both from ``/clock``."""
    if not drive.clock:
        return 0.0, 0.0
    first, last = drive.clock[0], drive.clock[-1]
    return (last.stamp_ns - first.stamp_ns) * 1e-9, last.arrived - first.arrived


def count_images(images: Sequence[Heard]) -> tuple[int, int]:
    """Return how many pictures were published and received between the first and last received.

    The stamps tell how many were published: the camera keeps its mean rate exactly.
    """
    stamps = {image.stamp_ns for image in images}
    if not stamps:
        return 0, 0
    span_s = (max(stamps) - min(stamps)) * 1e-9
    return round(span_s * NOMINAL_HZ["camera_hz"]) + 1, len(stamps)


def stamp_delays_ms(drive: HeardEpisode) -> list[float]:
    """Return simulated time from each picture to the decision on it, ms.

    A node reads time from ``/clock``, so each is up to one clock period (50 ms) too short.
    """
    return [(d.stamp_ns - d.image_ns) * 1e-6 for d in drive.decisions]


def real_delays_ms(drive: HeardEpisode) -> list[float]:
    """Return real time from the clock message of a picture's moment to its decision, ms.

    The simulator sends that message before it draws the picture, so drawing, both transports and
    the policy are in it. A decision whose clock message was not heard is left out.
    """
    began = {message.stamp_ns: message.arrived for message in drive.clock}
    return [(d.arrived - began[d.image_ns]) * 1e3 for d in drive.decisions if d.image_ns in began]


def percentiles(delays_ms: Sequence[float]) -> dict[str, float]:
    """Return p50 and p99 in ms and the number of samples.

    Raises:
        ValueError: there is no sample.
    """
    if not delays_ms:
        raise ValueError("no decision was heard, expected at least one")
    p50, p99 = np.percentile(delays_ms, (50, 99))
    return {"p50": round(float(p50), 1), "p99": round(float(p99), 1), "samples": len(delays_ms)}


def real_time_factor(drives: Iterable[HeardEpisode]) -> float | None:
    """Return simulated seconds per real second of the drives that held; None when none did."""
    simulated_s, wall_s = np.sum([(0.0, 0.0), *(spans_s(d) for d in drives if d.held)], axis=0)
    return round(float(simulated_s / wall_s), 2) if wall_s else None


def row(drive: HeardEpisode) -> dict[str, Any]:
    """Return one drive's line of ``live.json``."""
    simulated_s, wall_s = spans_s(drive)
    published, received = count_images(drive.sensors["camera_hz"])
    return {
        "room": drive.room,
        "goal": drive.goal,
        "speed": drive.speed,
        "outcome": drive.outcome,
        "message": drive.message,
        "decisions": len(drive.decisions),
        "simulated_s": round(simulated_s, 3),
        "wall_s": round(wall_s, 3),
        "images_published": published,
        "images_received": received,
        "images_lost": published - received,
    }


def figures(real_time: Sequence[HeardEpisode], fast: Sequence[HeardEpisode]) -> dict[str, Any]:
    """Return the measured figures.

    Args:
        real_time: drives at speed 1; rates and delays are theirs, also when they did not hold.
        fast: drives at speed 0; the real-time factor is theirs.

    Raises:
        ValueError: too little was heard to measure; one sentence.
    """
    rows = [row(drive) for drive in (*real_time, *fast)]
    return {
        **{
            name: round(rate_hz(drive.sensors[name] for drive in real_time), 3)
            for name in NOMINAL_HZ
        },
        "nominal_hz": NOMINAL_HZ,
        "image_to_action_ms": percentiles([ms for d in real_time for ms in stamp_delays_ms(d)]),
        "image_to_action_real_ms": percentiles([ms for d in real_time for ms in real_delays_ms(d)]),
        "images_lost": sum(line["images_lost"] for line in rows),
        "images_published": sum(line["images_published"] for line in rows),
        "real_time_factor": real_time_factor(fast),
        "drives_held": sum(drive.held for drive in (*real_time, *fast)),
        "drives": rows,
    }


def table(report: dict[str, Any]) -> str:
    """Return the content of ``live.json`` as a table for people."""
    load = report["load"]
    lines = [
        f"load {load['average_1min']:.2f} before the start, {load['cores']} cores of {load['cpu']}",
        f"bundle {report['bundle']}, commit {report['commit']}, {len(report['drives'])} drives",
        "",
        f"{'':<29}{'measured':>12}{'nominal':>12}{'share':>10}",
    ]
    for name, label in (("camera_hz", "camera"), ("scan_hz", "scan"), ("odom_hz", "odometry")):
        hz, nominal = report[name], report["nominal_hz"][name]
        lines.append(f"{label + ', Hz':<29}{hz:>12.2f}{nominal:>12.1f}{hz / nominal:>10.1%}")
    lines += ["", f"{'':<29}{'p50':>12}{'p99':>12}{'samples':>10}"]
    for name, label in (
        ("image_to_action_ms", "image to action, by stamps, ms"),
        ("image_to_action_real_ms", "the same, real time, ms"),
    ):
        delay = report[name]
        lines.append(f"{label:<30}{delay['p50']:>11.0f}{delay['p99']:>12.0f}{delay['samples']:>10}")
    lost = f"{report['images_lost']} of {report['images_published']}"
    held = f"{report['drives_held']} of {len(report['drives'])}"
    factor = report["real_time_factor"]
    return "\n".join([
        *lines,
        f"{'':<29}{'aim: p99 under ' + format(AIM_P99_MS, '.0f'):>24}",
        "",
        f"{'images lost':<29}{lost:>12}",
        f"{'drives the graph held':<29}{held:>12}",
        f"{'times real time':<29}{'none held' if factor is None else format(factor, '.2f'):>12}",
    ])  # fmt: skip
