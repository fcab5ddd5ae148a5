"""Trials of one bundle over the live graph, a line each in a file, going on where it stopped."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from cfnav_ros.live.demo import run_trial
from cfnav_ros.live.plan import Trial

from cfnav_core.files.json_lines import append_row, read_rows, write_rows
from cfnav_core.files.locks import locked
from cfnav_core.files.provenance import commit
from cfnav_core.files.whole import whole, writing
from cfnav_core.policy.bundle import BundleError, BundleHead
from studies.engine.jobs import Job
from studies.engine.row import Row, Schedule
from studies.live.identities import WORLD, identity_of
from studies.live.table_iv_rows import trials_of


def by_trial(rows: Iterable[dict[str, Any]]) -> dict[Trial, dict[str, Any]]:
    """The lines of a file of trials."""
    return {Trial(**row["trial"]): row for row in rows}


@dataclass(frozen=True)
class TrialDrive:
    """The trials of a row of Table IV by the policy of one training seed.

    Attributes:
        row: what drives, and how. seed, schedule: of training.
        bundle: that drives. file: of the trials. trials: how many.
    """

    row: Row
    seed: int
    schedule: Schedule
    bundle: Path
    file: Path
    trials: int

    def missing(self) -> list[Trial]:
        """Those that were not driven yet; the bundle is needed only when there are any.

        Raises:
            BundleError: it is missing, or of another training.
            OSError: the file holds trials of another bundle or simulator.
        """
        rows = read_rows(self.file)
        there = by_trial(rows).keys()
        missing = [trial for trial in trials_of(self.trials, self.seed) if trial not in there]
        if missing and any(row["world"] != WORLD for row in rows):
            raise OSError(
                f"{self.file} holds trials in another version of the simulator; remove it"
            )
        if missing:
            self._check_training()
        if missing or self.bundle.exists():
            other = {row["bundle"] for row in rows} - {identity_of(self.bundle)}
            if other:
                raise OSError(
                    f"{self.file} holds trials of another bundle ({other.pop()}); remove it"
                )
        return missing

    def _check_training(self) -> None:
        """See that a bundle of a preset's run is of the run that its folder's name says."""
        job = Job.of(BundleHead.load(self.bundle).training)
        if job is None:
            return
        row = self.row
        asked = Job(
            row.model, row.method, row.split, self.seed, job.preset, job.perception, self.schedule
        )
        if (job.split, job.config) != (row.split, asked.config):
            raise BundleError(
                f"found the bundle of {job.title} in {self.bundle}, expected {asked.title}; "
                "export that run"
            )

    def run(self, speed: float, domain: int | None) -> None:
        """Drive what is missing, and add it to the file.

        Args:
            speed: simulated seconds per second, 0 as fast as the machine can.
            domain: ROS domain, None for one that is free.
        """
        self.file.parent.mkdir(parents=True, exist_ok=True)
        with locked(self.file.with_suffix(".lock")):
            if missing := self.missing():  # another process may have driven them meanwhile
                self._run(missing, speed, domain)

    def _run(self, missing: list[Trial], speed: float, domain: int | None) -> None:
        # here, so that the command answers at once to --help and to arguments that make no sense
        from cfnav_ros.process.graph_config import GraphConfig
        from cfnav_ros.ros.graph import RosGraph

        row, there = self.row, read_rows(self.file)
        write_rows(self.file, there)
        said = {"bundle": identity_of(self.bundle), "run": run_of(self.bundle), "commit": commit()}
        said["world"] = WORLD
        print(f"{row.name}, training seed {self.seed}: {len(missing)} trials", flush=True)
        config = GraphConfig(
            room=missing[0].room, logs=self.file.parent / "logs" / self.file.stem, speed=speed,
            bundle=self.bundle, veto=row.veto, domain=domain, lock_step=True, p_hat=row.p_hat,
            # drives that go on do not draw the numbers of those before them again
            sample_seed=1000 * self.seed + len(there) if row.sample else None,
            visual_shift=row.visual_shift, track=True,
        )  # fmt: skip
        with RosGraph(config) as graph:
            for trial in missing:
                start = graph.start_episode(trial.room, trial.goal, trial.seed)
                if not start.ok:
                    raise OSError(start.message)
                outcome = asdict(run_trial(graph, trial))
                if graph.map is not None:
                    _keep_map(self.file.parent, trial.room, graph.map)
                track = [(round(x, 3), round(y, 3), n) for x, y, n in graph.track]
                line = {"trial": asdict(trial), **said, **outcome, "track": track}
                append_row(self.file, line)


def run_of(bundle: Path) -> dict[str, str]:
    """The training run that a bundle came from.

    Returns:
        preset and config_hash, empty when it is that of no preset, and the code's commit.
    """
    training = BundleHead.load(bundle).training
    job = Job.of(training)
    return {
        "preset": job.preset if job else "", "config_hash": job.hash if job else "",
        "commit": training.get("commit", "unknown"),
    }  # fmt: skip


def _keep_map(out: Path, room: str, message: Any) -> None:
    """Keep the map of a room, for the figure."""
    path = out / "maps" / f"{room.replace(':', '_')}.npz"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        info = message.info
        cells = np.array(message.data, np.int8).reshape(info.height, info.width)
        with writing(path), whole(path) as partial, partial.open("wb") as file:
            np.savez_compressed(file, occupied=cells > 0, resolution=info.resolution)
