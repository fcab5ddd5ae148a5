"""The ``cfnav`` command: train, export, evaluate, benchmark."""

from __future__ import annotations

import json
import shlex
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from cfnav_core.benchmark.command import Benchmark
from cfnav_core.bundle import BundleHead, find_bundle
from cfnav_core.config import PHat, Rooms, TrainOptions
from cfnav_core.data_cli import Data
from cfnav_core.json_file import write_json


@dataclass(frozen=True)
class Evaluate:
    """Run a bundle, or a run's checkpoint, on frozen episodes over offline scenes."""

    policy: Annotated[Path, tyro.conf.Positional]
    """A bundle, or a checkpoint such as best.safetensors."""
    scenes: Path
    """Folder or store of scenes made with its perception."""
    episodes: int = 1000
    """Number of episodes."""
    seed: int = 0
    """Draws starts and goals."""
    frozen: Path | None = None
    """Episodes of a file (cfnav data freeze, cfnav data episodes) instead of drawn ones."""
    rooms: Rooms = ()
    """TYPE:FIRST-LAST or data2:test; names or splits of a store; every scene when absent."""
    sample: bool = False
    """Sample actions instead of taking the most probable one."""
    p_hat: PHat = "own"
    """Collision probability: its own prediction, zero, its own of another episode, the true flag,
    what the LiDAR says (python -m sim_bridge.scans, then python -m cfnav_ros.lidar_states), or the
    larger of that and its own."""
    veto: bool = False
    """The LiDAR may forbid a MoveAhead, as on the robot."""
    against: Path | None = None
    """A second bundle or checkpoint on the same episodes: adds the paired difference."""
    json: Path | None = None
    """Also write every figure here."""

    def run_command(self) -> None:
        """Evaluate and print."""
        # scenes are read into torch tensors, and a robot has no torch
        from cfnav_core.evaluate import evaluate, paired_difference

        arguments = (
            self.scenes, self.episodes, self.seed, self.sample, self.p_hat, self.rooms,
            self.frozen, self.veto,
        )  # fmt: skip
        first = evaluate(self.policy, *arguments)
        command = shlex.join(["cfnav", *sys.argv[1:]])
        content: dict[str, Any] = {"command": command, **first.summary()}
        _print(self.policy, content)
        if self.against is not None:
            second = evaluate(self.against, *arguments)
            _print(self.against, second.summary())
            content |= {"against": second.summary()}
            content |= {"paired": paired_difference(first, second)}
            paired = content["paired"]
            low, high = paired["interval"]
            print(f"CF-SR difference {paired['cf_sr_difference']:+.3f} [{low:+.3f}, {high:+.3f}]")
        if self.json is not None:
            write_json(self.json, content)


@dataclass(frozen=True)
class Export:
    """Turn a checkpoint into a bundle for the robot."""

    checkpoint: Annotated[Path, tyro.conf.Positional]
    """best.safetensors of a run."""
    perception: Path
    """perception.onnx the scenes of the run were made with."""
    out: Path
    """Folder of the bundle."""
    name: str = "cfnav"
    """Name of the bundle."""
    metrics: Path | None = None
    """JSON of cfnav evaluate, kept in bundle.json."""
    live: Path | None = None
    """JSON of python -m cfnav_ros.live_results, kept beside them."""
    commands: str = ""
    """Where the commands stand that made it, for the card."""

    def run_command(self) -> None:
        """Export."""
        from cfnav_core.export import export_bundle

        metrics = json.loads(self.metrics.read_text()) if self.metrics else {}
        if self.live:
            metrics["live"] = json.loads(self.live.read_text())
        export_bundle(self.checkpoint, self.perception, self.out, self.name, metrics, self.commands)
        size = sum(f.stat().st_size for f in self.out.iterdir())
        print(f"wrote {self.out} ({size / 1e6:.1f} MB)")


@dataclass(frozen=True)
class Info:
    """Show what a bundle is."""

    bundle: Annotated[Path | None, tyro.conf.Positional] = None
    """Folder of the bundle, or the name of a shipped one; the default when absent."""

    def run_command(self) -> None:
        """Print the bundle's head."""
        head = BundleHead.load(find_bundle(self.bundle))
        print(json.dumps(head.__dict__, indent=1))


def _print(policy: Path, f: dict[str, Any]) -> None:
    low, high = f["cf_sr_interval"]
    print(
        f"{policy} ({f['model']}, {f['method']}): {f['episodes']} episodes  "
        f"SR {f['sr']:.3f}  SPL {f['spl']:.3f}  "
        f"CF-SR {f['cf_sr']:.3f} [{low:.3f}, {high:.3f}]  CF-SPL {f['cf_spl']:.3f}  "
        f"collisions {f['collisions_per_episode']:.2f}"
    )


@dataclass(frozen=True)
class Train(TrainOptions):
    """Train a navigation policy on offline scenes: Algorithm 1, two stages (needs torch).

    For example: cfnav train --scenes out/rooms --train-rooms data2:train
    --validation-rooms data2:validation --method ours --out out/runs/ours

    Run it again to go on after a kill. The best checkpoint by CF-SR on the validation rooms is
    best.safetensors, which cfnav export turns into a bundle; log.jsonl and TensorBoard files in
    the same folder have the curves.
    """

    def run_command(self) -> None:
        """Train."""
        # a robot has no torch, so it is imported only here
        from cfnav_core.train import train

        best = train(self)
        print(f"best checkpoint by validation: {best}")


Command = (
    Annotated[Train, tyro.conf.subcommand("train"), tyro.conf.OmitArgPrefixes]
    | Annotated[Export, tyro.conf.subcommand("export")]
    | Annotated[Evaluate, tyro.conf.subcommand("evaluate")]
    | Annotated[Benchmark, tyro.conf.subcommand("benchmark")]
    | Annotated[Info, tyro.conf.subcommand("info")]
    | Annotated[Data, tyro.conf.subcommand("data", description="Data sets: look, check, convert.")]
)


def main() -> None:
    """Entry point: exit 2 with one sentence on bad input, 130 when it was told to stop."""
    try:
        tyro.cli(Command, prog="cfnav").run_command()  # type: ignore[call-overload]
    except ModuleNotFoundError as error:
        print(f"cfnav: found no {error.name}, which this command needs; install it with "
              "pip install 'cfnav[train]'", file=sys.stderr)  # fmt: skip
        sys.exit(2)
    except (ValueError, OSError) as error:
        print(f"cfnav: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt as stop:
        print(f"cfnav: {str(stop) or 'stopped'}", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
