"""What the deployment does, measured: ``make bench-deploy``, or ``python -m studies.deploy.bench``.

Runs the measuring programs one after the other and writes ``deploy.json``, ``deploy.md`` and
pictures. It judges nothing by time; the machine's load stands beside what was measured. Parts that
are left out keep the figures of an earlier run.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from cfnav_core.command import run_options
from studies.deploy import matrix_report
from studies.parts import measure_parts


@dataclass(frozen=True)
class DeployConfig:
    """Measure the fault matrix, motions, the LiDAR node, its calibration, CPU and memory."""

    out: Path = Path("out/bench")
    """Folder of the results."""
    only: str = ""
    """Parts to measure, comma-separated: matrix, motion, lidar, calibration, usage; empty: all."""
    runs: int = field(default_factory=lambda: int(os.environ.get("RUNS", "5")))
    """Runs of each cell of the fault matrix; the environment's RUNS when not given."""
    graphs: int = 3
    """Live graphs side by side."""


def _matrix(config: DeployConfig) -> dict[str, Any]:
    from studies.deploy.fault_matrix import MatrixConfig, measure

    rows = measure(
        MatrixConfig(config.out / "faults.jsonl", runs=config.runs, graphs=config.graphs)
    )
    cells = matrix_report.summarise(rows)
    matrix_report.draw(cells, config.out / "fault_matrix.png")
    return {"fault_matrix": cells}


def _motion(config: DeployConfig) -> dict[str, Any]:
    from studies.deploy.motion_error import MotionConfig, measure

    return {"motion_error": measure(MotionConfig(config.out, graphs=config.graphs))}


def _lidar(_: DeployConfig) -> dict[str, Any]:
    from studies.deploy.scan_time import measure

    return {"lidar_node_ms": measure()}


def _calibration(config: DeployConfig) -> dict[str, Any]:
    from studies.deploy.calibration import CalibrationConfig, measure

    return {"calibration": measure(CalibrationConfig(config.out))}


def _usage(config: DeployConfig) -> dict[str, Any]:
    from studies.deploy.usage import UsageConfig, measure

    found = measure(UsageConfig(config.out))
    return {name: found[name] for name in ("cpu_share", "rss_slope_mb_per_h", "rss_mb", "driven")}


# Each part imports its own program, so that one that cannot run leaves the others whole.
PARTS: dict[str, Callable[[DeployConfig], dict[str, Any]]] = {
    "matrix": _matrix,
    "motion": _motion,
    "lidar": _lidar,
    "calibration": _calibration,
    "usage": _usage,
}


def measure(config: DeployConfig) -> dict[str, Any]:
    """Measure the parts and write the results after each; see ``measure_parts``."""

    def after(name: str, found: dict[str, Any]) -> None:
        if name == "matrix":  # its rows grow over several calls
            commits = {name for cell in found["fault_matrix"] for name in cell["commits"]}
            found["measured"][name]["commit"] = ", ".join(sorted(commits))
        (config.out / "deploy.md").write_text(page(found))

    parts = {name: partial(part, config) for name, part in PARTS.items()}
    path = config.out / "deploy.json"
    return measure_parts(path, "studies.deploy.bench", parts, config.only, after)


def page(found: dict[str, Any]) -> str:
    """The results as Markdown for the docs."""
    lines = ["| measured | figures | command | commit | load |", "|---|---|---|---|---|"]
    keys = {
        "motion": ("motion_error",), "lidar": ("lidar_node_ms",), "calibration": ("calibration",),
        "usage": ("cpu_share", "rss_slope_mb_per_h", "rss_mb", "driven"),
    }  # fmt: skip
    for part, about in found["measured"].items():
        for key in keys.get(part, ()):
            lines.append(
                f"| {key} | {_figures(found[key])} | `{about['command']}` | {about['commit']} | "
                f"{about['load_before']} to {about['load_after']}, {about['cores']} cores |"
            )
    if "fault_matrix" in found:
        lines += ["", matrix_report.table(found["fault_matrix"])]
    return "\n".join(lines) + "\n"


def _figures(values: Any) -> str:
    if isinstance(values, dict):
        return "; ".join(f"{name} {_figures(value)}" for name, value in values.items())
    return f"{values:.3g}" if isinstance(values, float) else str(values)


def main(config: DeployConfig) -> None:
    """Measure and print."""
    measure(config)
    print((config.out / "deploy.md").read_text())


if __name__ == "__main__":
    sys.exit(run_options("bench-deploy", DeployConfig, main))
