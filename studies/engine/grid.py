"""Carries out the tasks of a grid on all cores, or on a Ray cluster; goes on where it stopped."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple, Protocol

from tqdm import tqdm

from cfnav_core.learn.run_files import LOG
from studies.engine.work import Task

POLL_S = 0.5


class GridError(ValueError):
    """Some tasks could not be done; the text is one sentence."""


class Process(Protocol):
    """Does a task somewhere; as a ``subprocess.Popen``."""

    def poll(self) -> int | None:
        """The exit code, None while it runs."""
        ...

    def terminate(self) -> None:
        """Tell it to end; a run ends between two rounds, with a checkpoint."""
        ...

    def wait(self) -> int:
        """The exit code, when it has ended."""
        ...


def start_process(task: Path, log: Path) -> Process:
    """Start the task of a file on this machine; what it says goes to a log."""
    with log.open("ab") as output:
        return subprocess.Popen(
            [sys.executable, "-m", "studies.engine.work", str(task)],
            stdin=subprocess.DEVNULL, stdout=output, stderr=output,
        )  # fmt: skip


class Executor(NamedTuple):
    """Where tasks run: how many at once, and how one is started, see ``start_process``."""

    slots: int
    start: Callable[[Path, Path], Process]


@contextmanager
def executor_of(jobs: int, ray: str) -> Iterator[Executor]:
    """Runs tasks here, or on a Ray cluster.

    Args:
        jobs: side by side on this machine.
        ray: address of the cluster, "local" starts one; empty: none.
    """
    if not ray:
        yield Executor(jobs, start_process)
        return
    # few have Ray
    from studies.engine.ray_cluster import ray_cluster

    with ray_cluster(ray, jobs) as executor:
        yield executor


def run_tasks(tasks: Sequence[Task], executor: Executor) -> None:
    """Do what is not done yet, in the given order as far as it is ready.

    Raises:
        GridError: tasks failed, or wait for such; the others have been done. Or some wait for what
            will never be there; nothing has been done.
    """
    waiting = [task for task in tasks if not task.result.exists()]
    trained = {task.folder for task in waiting if not task.test}
    if stuck := next(filter(None, (task.stuck(trained) for task in waiting)), ""):
        raise GridError(stuck)
    running: dict[Task, Process] = {}
    failed: list[Task] = []
    total = tqdm(total=len(tasks), initial=len(tasks) - len(waiting), unit="task", position=0)
    lines = _Lines(executor.slots)
    try:
        while running or any(task.ready for task in waiting):
            for task in [t for t in waiting if t.ready][: executor.slots - len(running)]:
                waiting.remove(task)
                task.folder.mkdir(parents=True, exist_ok=True)
                running[task] = executor.start(task.save(), task.result.with_suffix(".log"))
            time.sleep(POLL_S)
            lines.show(running)
            for task in list(running):
                code = running[task].poll()
                if code is None:
                    continue
                del running[task]
                total.update()
                if code or not task.result.exists():
                    failed.append(task)
                    tqdm.write(f"failed: {task.name}; see {task.result.with_suffix('.log')}")
                else:
                    tqdm.write(f"done: {task.name} {_last(task)}")
    finally:
        for process in running.values():
            process.terminate()
        for process in running.values():
            process.wait()
        lines.close()
        total.close()
    if failed or waiting:
        first = (failed or waiting)[0]
        raise GridError(
            f"{len(failed)} tasks failed and {len(waiting)} wait for such, the first is "
            f"{first.name}; see {first.result.with_suffix('.log')}, then run the same command again"
        )


class _Lines:
    """A line of progress for each running task, below that of all."""

    def __init__(self, slots: int) -> None:
        seen = sys.stderr.isatty()  # elsewhere each line would be written again and again
        self._bars = [
            tqdm(bar_format="{desc}", position=n + 1, leave=False)
            for n in range(slots if seen else 0)
        ]

    def show(self, running: Iterable[Task]) -> None:
        """Say where each is."""
        for bar, task in zip(self._bars, [*running, *[None] * len(self._bars)], strict=False):
            bar.set_description_str(f"{task.name} {_last(task)}" if task else "")

    def close(self) -> None:
        """Remove the lines."""
        for bar in self._bars:
            bar.close()


def _last(task: Task) -> str:
    """What the log of a training run said last."""
    path = task.folder / LOG
    if task.test or not path.exists():
        return ""
    lines = path.read_text().splitlines()
    try:
        f = json.loads(lines[-1])
    except (ValueError, IndexError):
        return ""
    hp = task.job.config.hyperparameters
    return (
        f"{f['episodes']:,} of {hp.stage1_episodes + hp.stage2_episodes:,} episodes, "
        f"{f['steps_per_s']:,.0f} steps/s, training CF-SR {f['cf_sr']:.2f}, "
        f"validation {f['validation_cf_sr']:.2f}"
    )
