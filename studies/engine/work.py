"""One unit of work of a grid in a process of its own: ``python -m studies.engine.work TASK``.

The task is a file, so that any machine that sees the grid's folder can do it, and it goes on where
it was stopped.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Container
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import torch

from cfnav_core.command import ending
from cfnav_core.files.checkpoint import load_tensors
from cfnav_core.files.json_file import write_json
from cfnav_core.files.locks import locked
from cfnav_core.learn.run_files import BEST
from cfnav_core.learn.train import train
from studies.engine.episodes import RunTest
from studies.engine.jobs import GridFolders, Job

DONE = "done.json"
"""In a run's folder: the hash of its configuration, its commit, and what its checkpoint reached."""


@dataclass(frozen=True)
class Task:
    """What is to be done.

    Attributes:
        job: the run.
        places: of the grid.
        test: test it instead of training it.
        device, precision: see ``TrainOptions``.
    """

    job: Job
    places: GridFolders
    test: RunTest | None = None
    device: str = "auto"
    precision: str = "highest"

    @property
    def folder(self) -> Path:
        """Of the run."""
        return self.job.options(self.places).out

    @property
    def name(self) -> str:
        """In words, for people."""
        return f"{self.job.title}: {self.test.name if self.test else 'train'}"

    @property
    def result(self) -> Path:
        """The file that says that it is done."""
        return self.test.result(self.folder) if self.test else self.folder / DONE

    @property
    def ready(self) -> bool:
        """Whether what it goes on from is there."""
        if self.test:
            return (self.folder / DONE).exists()
        source = self.job.options(self.places).stage1
        return source is None or source.exists()

    def stuck(self, trained: Container[Path]) -> str:
        """Why what it goes on from will never be there, as a sentence; empty when it may be.

        Args:
            trained: folders of runs that are being trained.
        """
        if self.test:
            return "" if self.folder in trained else self._untestable
        source = self.job.options(self.places).stage1
        if source is None or source.exists() or not (source.parent / DONE).exists():
            return ""
        return (
            f"found {source.parent} with results but without {source.name}, from which "
            f"{self.job.title} goes on; remove that folder to train it again, or ask only for "
            "what is recorded (--recorded)"
        )

    @property
    def _untestable(self) -> str:
        done, best = ((self.folder / file).exists() for file in (DONE, BEST))
        if not done:
            return (
                f"found no trained run {self.job.title} in {self.folder}; train it with cfnav "
                "benchmark first"
            )
        if not best:
            return (
                f"found {self.folder} with results but without {BEST}, which is to be tested; "
                "remove that folder to train it again, or ask only for what is recorded "
                "(--recorded)"
            )
        return ""

    def save(self) -> Path:
        """Write it down for the process that does it."""
        path = self.result.with_suffix(".task.json")
        content: dict[str, Any] = asdict(self)
        content["places"] = {k: str(v) for k, v in asdict(self.places).items()}
        if self.test:
            content["test"] = {**asdict(self.test), "frozen": str(self.test.frozen or "")}
        write_json(path, content)
        return path

    @classmethod
    def load(cls, path: Path) -> Task:
        """Read what ``save`` wrote."""
        found = json.loads(path.read_text())
        places = GridFolders(**{k: Path(v) for k, v in found.pop("places").items()})
        test = found.pop("test")
        if test:
            test["frozen"] = Path(test["frozen"]) if test["frozen"] else None
        of = RunTest(**test) if test else None
        return cls(job=Job(**found.pop("job")), places=places, test=of, **found)

    def do(self) -> None:
        """Train or test, and write the result.

        Raises:
            OSError: another process does it.
        """
        torch.set_num_threads(1)
        with locked(self.result.with_suffix(".lock")):
            self._do()

    def _do(self) -> None:
        if self.test:
            self.test.run(self.folder, self.places.scenes)
            return
        options = self.job.options(self.places)
        options = replace(options, device=self.device, precision=self.precision)  # type: ignore[arg-type]
        _, head = load_tensors(train(options))
        reached = {"commit": head["commit"], "validation_cf_sr": head["best"]}
        write_json(self.result, {"config_hash": self.job.hash} | reached)


if __name__ == "__main__":
    sys.exit(ending("cfnav benchmark", lambda: Task.load(Path(sys.argv[1])).do()))
