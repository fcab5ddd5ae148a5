"""Measure how fast a bundle decides, on one core: ``python -m studies.bench.policy``.

A decision is one picture through perception, collision predictor and policy. Each back end is
measured in a process of its own, so that neither has the other's memory or imports. The onnx row
needs no torch, so it can be measured on the robot.
"""

from __future__ import annotations

import os
import resource
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Literal

import numpy as np

from cfnav_core.command import command_line, run_options
from cfnav_core.files.json_file import write_json
from cfnav_core.policy.bundle import PERCEPTION, BundleHead, find_bundle

WARM_UP = 20
"""Decisions before the clock runs."""

SIDE = 300
"""Of the pictures, pixels, as the camera gives them."""


@dataclass(frozen=True)
class PolicyBenchOptions:
    """Measure how fast a bundle decides, on one core."""

    bundle: Path | None = None
    """Folder of a bundle, or the name of a shipped one; the default when absent."""
    backends: tuple[Literal["onnx", "torch"], ...] = ("onnx", "torch")
    """What runs policy and predictor; perception runs on ONNX Runtime in both."""
    decisions: int = 500
    """Decisions to time."""
    json: Path | None = None
    """Also write the figures here."""


@dataclass(frozen=True)
class Figures:
    """What one back end took.

    Attributes:
        backend: onnx or torch.
        load_s: wall time from nothing imported to a policy that is ready.
        p50_ms, p99_ms: wall time of a decision.
        cpu_ms: processor time of a decision, mean.
        perception_p50_ms: wall time of its perception alone.
        peak_rss_mb: most memory that the process held.
        decisions: how many were timed.
    """

    backend: str
    load_s: float
    p50_ms: float
    p99_ms: float
    cpu_ms: float
    perception_p50_ms: float
    peak_rss_mb: float
    decisions: int


def measure(bundle: Path, backend: Literal["onnx", "torch"], decisions: int) -> Figures:
    """Measure one back end; call it in a fresh process, which it binds to one core.

    Raises:
        BundleError: the bundle cannot be used, or not with this back end.
    """
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    os.environ["OMP_NUM_THREADS"] = "1"  # read when torch is imported
    begun = time.perf_counter()
    # what a robot imports to decide is part of its loading
    from cfnav_core.perception.perception import OnnxPerception
    from cfnav_core.policy.policy import Policy

    known = BundleHead.load(bundle).room_types
    policy = Policy.load(bundle, backend, room_type=next(iter(known), ""))
    policy.reset(policy.goals[0])
    load_s = time.perf_counter() - begun
    pictures = np.random.default_rng(0).integers(0, 256, (8, SIDE, SIDE, 3), np.uint8)
    decided, cpu_s = _times(policy.act, pictures, decisions)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    seen, _ = _times(
        OnnxPerception(BundleHead.load(bundle).file(bundle, PERCEPTION)).observe,
        pictures,
        decisions,
    )
    p50, p99 = np.percentile(decided, (50, 99))
    return Figures(
        backend, round(load_s, 2), _ms(p50), _ms(p99), _ms(cpu_s / decisions),
        _ms(np.median(seen)), round(peak), decisions,
    )  # fmt: skip


def _ms(seconds: float | np.floating) -> float:
    return round(float(seconds) * 1e3, 3)


def _times(
    call: Callable[[np.ndarray], object], pictures: np.ndarray, count: int
) -> tuple[np.ndarray, float]:
    """Wall times of so many calls after the warm-up, seconds, and their processor time."""
    for k in range(WARM_UP):
        call(pictures[k % len(pictures)])
    times, cpu = np.empty(count), time.process_time()
    for k in range(count):
        begun = time.perf_counter()
        call(pictures[k % len(pictures)])
        times[k] = time.perf_counter() - begun
    return times, time.process_time() - cpu


def main(options: PolicyBenchOptions) -> None:
    """Measure and print every back end.

    Raises:
        ValueError: a bundle that cannot be used, or nothing to time.
    """
    if options.decisions < 1:
        raise ValueError(f"found --decisions {options.decisions}, expected at least 1")
    bundle = find_bundle(options.bundle)
    print(f"bundle {BundleHead.load(bundle).name} at {bundle}, one core")
    print("back end  load, s  p50, ms  p99, ms  cpu, ms  perception alone p50, ms  peak RSS, MB")
    figures = []
    for backend in options.backends:
        with ProcessPoolExecutor(1, get_context("spawn")) as process:
            f = process.submit(measure, bundle, backend, options.decisions).result()
        print(
            f"{f.backend:8}  {f.load_s:7.2f}  {f.p50_ms:7.2f}  {f.p99_ms:7.2f}  {f.cpu_ms:7.2f}  "
            f"{f.perception_p50_ms:24.2f}  {f.peak_rss_mb:12.0f}"
        )
        figures.append(f)
    if options.json is not None:
        rows = [*map(asdict, figures)]
        write_json(options.json, {"command": command_line(), "rows": rows})


if __name__ == "__main__":
    sys.exit(run_options("bench_policy", PolicyBenchOptions, main))
