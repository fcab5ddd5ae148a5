"""``cfnav train``, ``evaluate``, ``export`` and ``info``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from cfnav_core.agent.config import Rooms, TrainOptions
from cfnav_core.command import command_line
from cfnav_core.files.json_file import write_json
from cfnav_core.policy.bundle import CARD, REMEDY, BundleError, BundleHead, find_bundle
from cfnav_core.task.intervals import ends_text
from cfnav_core.task.metrics import paired_text
from cfnav_core.task.p_hat import TESTED

FIGURES = (
    "command", "episodes", "sr", "spl", "cf_sr", "cf_spl", "cf_sr_interval",
    "collisions_per_episode",
)  # fmt: skip
EVALUATED = (*FIGURES, "scenes", "episodes_identity", "cf_sr_by_goal")
DRIVEN = (*FIGURES, "rooms", "veto", "speed", "commits")
"""What the card of a bundle reads in the JSON of its figures, and of its drives."""


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
    p_hat: Annotated[str, tyro.conf.arg(metavar=f"{{{','.join(TESTED)}}}")] = "own"
    """Collision probability: its own prediction, zero, its own of another episode, the true flag,
    what the LiDAR says (cfnav rooms scan, then cfnav data lidar),
    or the larger of that and its own."""
    veto: bool = False
    """The LiDAR may forbid a MoveAhead, as on the robot."""
    against: Path | None = None
    """A second bundle or checkpoint on the same episodes: adds the paired difference."""
    json: Path | None = None
    """Also write every figure here."""

    def run_command(self) -> None:
        """Evaluate and print."""
        # scenes are read into torch tensors, and a robot has no torch
        from cfnav_core.learn.evaluate import evaluate, paired_difference

        arguments = (
            self.scenes, self.episodes, self.seed, self.sample, self.p_hat, self.rooms,
            self.frozen, self.veto,
        )  # fmt: skip
        first = evaluate(self.policy, *arguments)
        content: dict[str, Any] = {"command": command_line(), **first.summary()}
        _print(self.policy, content)
        if self.against is not None:
            second = evaluate(self.against, *arguments)
            _print(self.against, second.summary())
            content |= {"against": second.summary()}
            content |= {"paired": paired_difference(first, second)}
            print(f"CF-SR difference {paired_text(content['paired'])}")
            if of_rest := content["paired"]["other_goals"]:
                print(f"  of goals that the first was not trained to find {paired_text(of_rest)}")
        if self.json is not None:
            write_json(self.json, content)


@dataclass(frozen=True)
class Export:
    """Turn a checkpoint into a bundle for the robot."""

    checkpoint: Annotated[Path, tyro.conf.Positional]
    """best.safetensors of a run."""
    out: Path
    """Folder of the bundle."""
    perception: Path | None = None
    """perception.onnx the scenes of the run were made with; none for one that reads sightings
    (cfnav rooms boxes)."""
    name: str = "cfnav"
    """Name of the bundle."""
    metrics: Path | None = None
    """JSON of cfnav evaluate, kept in bundle.json."""
    live: Path | None = None
    """JSON of python -m studies.live.live_results, kept beside them."""
    commands: str = ""
    """Where the commands stand that made it, for the card."""
    also: Annotated[list[str], tyro.conf.UseAppendAction] = field(default_factory=list)
    """A further name that it may be asked for, or a map of labels such as coco, given as often as
    needed; for models that take goals they never trained on, with a detector that knows them."""

    def run_command(self) -> None:
        """Export."""
        from cfnav_core.learn.export import export_bundle

        metrics = _figures(self.metrics, EVALUATED, "cfnav evaluate") if self.metrics else {}
        if self.live:
            metrics["live"] = _figures(self.live, DRIVEN, "python -m studies.live.live_results")
        export_bundle(
            self.checkpoint, self.perception, self.out, self.name, metrics, self.commands, self.also
        )
        size = sum(f.stat().st_size for f in self.out.iterdir())
        print(f"wrote {self.out} ({size / 1e6:.1f} MB)")


@dataclass(frozen=True)
class Info:
    """Show the model card of a bundle: what it is for, and what was measured."""

    bundle: Annotated[Path | None, tyro.conf.Positional] = None
    """Folder of the bundle, or the name of a shipped one; the default when absent."""
    json: bool = False
    """Its bundle.json instead of its model card: every figure, room and hash."""

    def run_command(self) -> None:
        """Print it, once every file was checked against its hash."""
        folder = find_bundle(self.bundle)
        head = BundleHead.load(folder)
        try:
            print(head.text if self.json else (folder / CARD).read_text().rstrip())
        except FileNotFoundError as error:
            raise BundleError(
                f"found no {CARD} in {folder}; see its bundle.json with --json, or {REMEDY}"
            ) from error


def _figures(path: Path, keys: Sequence[str], command: str) -> dict[str, Any]:
    """Figures as a command writes them.

    Raises:
        ValueError: the file has others, or is none.
    """
    try:
        found = json.loads(path.read_text())
    except ValueError as error:
        raise ValueError(f"found no JSON in {path} ({error}); expected that of {command}") from None
    lacking = [key for key in keys if not isinstance(found, dict) or key not in found]
    if lacking:
        raise ValueError(f"found no {', '.join(lacking)} in {path}; expected the JSON of {command}")
    return dict(found)


def _print(policy: Path, f: dict[str, Any]) -> None:
    who = f"{policy} ({f['model']}, {f['method']})"
    print(f"{who}: {_line(f)}  wrong Done {f['wrong_done']:.3f}")
    if f["other_goals"]:
        if f["trained_goals"]:
            print(f"  goals that it was trained to find: {_line(f['trained_goals'])}")
        print(f"  goals that it was not trained to find: {_line(f['other_goals'])}")


def _line(f: dict[str, Any]) -> str:
    return (
        f"{f['episodes']} episodes  SR {f['sr']:.3f}  SPL {f['spl']:.3f}  "
        f"CF-SR {f['cf_sr']:.3f} {ends_text(f['cf_sr_interval'])}  CF-SPL {f['cf_spl']:.3f}  "
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
        from cfnav_core.learn.train import train

        best = train(self)
        print(f"best checkpoint by validation: {best}")
