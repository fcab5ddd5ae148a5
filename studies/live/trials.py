"""Long trials over the live graph: ``python -m studies.live.trials episodes --episodes 60``.

Writes one JSON line for each episode as soon as it ends, and goes on where it stopped. Records no
bag; the outcome is the simulator's own. ``table-iv`` instead drives the paper's Table IV.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from cfnav_ros.drive.outcome import Outcome, figures
from cfnav_ros.live.demo import DemoConfig, known_goals, run_trials
from cfnav_ros.live.plan import Trial, parse_list

from cfnav_core.command import command_line, run_options
from cfnav_core.detect.errors import SHIPPED
from cfnav_core.files.json_lines import append_row, read_rows, write_rows
from cfnav_core.files.locks import locked
from cfnav_core.files.provenance import commit, sha256
from cfnav_core.policy.bundle import BundleHead
from cfnav_core.task.vocabulary import ROOM_TYPES
from studies.live import table_iv
from studies.live.drive import by_trial
from studies.live.identities import identity_of, world_of
from studies.live.table_iv import TableIV

TEST_ROOMS = ",".join(f"{kind}:{seed}" for seed in range(20, 30) for kind in ROOM_TYPES)

CONDITIONS = (
    "bundle", "networks", "speed", "veto", "lock_step", "camera", "max_steps", "world", "detector",
    "depth_down_deg",
)  # fmt: skip
"""What each line repeats, and what all lines of a file must share: as asked for, and the identities
of the bundle's networks and of the simulator, which change under one name."""

UNSAID = {"camera": "mast", "max_steps": 0, "detector": "", "depth_down_deg": None}
"""What held for lines that were written before this was a condition."""


@dataclass(frozen=True)
class TrialsConfig(DemoConfig):
    """Run many episodes over a real ROS 2 graph, resumable, and measure them."""

    room: str = TEST_ROOMS
    """Rooms, comma-separated, each <type>:<seed>; the default are all test rooms."""
    out: Path = Path("out/trials.jsonl")
    """File of the results, one JSON line for each episode; episodes in it are not run again."""
    episodes: int = 60
    """Number of episodes."""
    veto: bool = False
    """The LiDAR may forbid a MoveAhead; off where the policy itself is measured."""
    lock_step: bool = True
    """The simulator waits for the policy at every moment, so that each episode repeats itself."""


def detector_of(config: TrialsConfig) -> str:
    """What detects, by its content: a name may come to mean another; "" where nothing does."""
    if not BundleHead.load(config.drives).reads_sightings:
        return ""
    path = SHIPPED if config.detector == "shipped" else Path(config.detector)
    return f"{sha256(path)[:16]} {config.labels}"


def camera_of(config: TrialsConfig) -> str:
    """Whose pictures, a file by its content, too."""
    path = Path(config.camera)
    return f"{config.camera} {sha256(path)[:16]}" if path.is_file() else config.camera


def conditions_of(row: dict[str, Any]) -> dict[str, Any]:
    """Under which conditions the episode of a line was run."""
    return {name: row.get(name, UNSAID.get(name)) for name in CONDITIONS}


def run(config: TrialsConfig) -> list[Outcome]:
    """Run what is missing and return all outcomes.

    Raises:
        GraphError: the graph did not run.
        OSError: the file of results cannot be read or written, or holds other trials.
    """
    known = known_goals(config)
    config.out.parent.mkdir(parents=True, exist_ok=True)
    with locked(config.out.with_suffix(".lock")):
        return _run(config, known)


def _run(config: TrialsConfig, known: Sequence[str]) -> list[Outcome]:
    # Here, so that the command answers at once to --help and to arguments that make no sense.
    from cfnav_ros.process.graph_config import GraphConfig
    from cfnav_ros.ros.graph import RosGraph

    rows = read_rows(config.out)
    asked = {
        **asdict(config), "bundle": str(config.bundle or "shipped"),
        "networks": identity_of(config.drives), "world": world_of(config.rooms),
        "detector": detector_of(config), "camera": camera_of(config),
    }  # fmt: skip
    conditions = {name: asked[name] for name in CONDITIONS}
    for row in rows:
        found = conditions_of(row)
        if found != conditions:
            raise OSError(
                f"{config.out} holds episodes run with {found}, not {conditions}; "
                "choose another --out"
            )
    write_rows(config.out, rows)
    there = by_trial(rows)
    logs = config.out.with_suffix(".logs")
    room = parse_list(config.room)[0]
    graph_config = GraphConfig(
        room=room,
        room_type=config.room_type,
        logs=logs,
        speed=config.speed,
        bundle=config.bundle,
        veto=config.veto,
        domain=config.domain,
        lock_step=config.lock_step,
        camera=config.camera,
        depth_down_deg=config.depth_down_deg,
        detector=config.detector,
        labels=config.labels,
    )

    def done(trial: Trial, outcome: Outcome) -> None:
        row = {"trial": asdict(trial), **conditions, "commit": commit(), **asdict(outcome)}
        rows.append(row)
        append_row(config.out, row)

    with RosGraph(graph_config) as graph:
        run_trials(graph, config, known, done, skip=there.__contains__)
    names = Outcome.__dataclass_fields__
    return [Outcome(**{name: row[name] for name in names}) for row in rows]


Command = (
    Annotated[TrialsConfig, tyro.conf.subcommand("episodes")]
    | Annotated[TableIV, tyro.conf.subcommand("table-iv")]
)


def main(config: TrialsConfig | TableIV) -> None:
    """Run the episodes and print what came of them."""
    if isinstance(config, TableIV):
        table_iv.run(config, command_line())
        return
    outcomes = run(config)
    values = "  ".join(f"{name} {value:.3f}" for name, value in figures(outcomes).items())
    print(f"{len(outcomes)} episodes  {values}  ({config.out})")


if __name__ == "__main__":
    sys.exit(run_options("trials", Command, main))
