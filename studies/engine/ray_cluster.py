"""The tasks of a grid on a Ray cluster: every machine must see the grid's folder at its path."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studies.engine.grid import POLL_S, Executor, start_process

STOPPING_S = 60
"""A worker has so long to end a run with a checkpoint."""


@contextmanager
def ray_cluster(address: str, jobs: int) -> Iterator[Executor]:
    """Join a cluster; "local" starts one on this machine, of as many workers as ``jobs``.

    Raises:
        ModuleNotFoundError: Ray is not installed.
        ConnectionError: there is no cluster at the address.
    """
    import ray

    ray.init(
        address=address, log_to_driver=False, configure_logging=False,
        num_cpus=jobs if address == "local" else None,
    )  # fmt: skip
    work = ray.remote(num_cpus=1, max_retries=0)(_do)
    try:
        yield Executor(
            int(ray.cluster_resources().get("CPU", 1)),
            lambda task, log: OnWorker(ray, work.remote(str(task.resolve()), str(log.resolve()))),
        )
    finally:
        ray.shutdown()


@dataclass(frozen=True)
class OnWorker:
    """A remote function, see ``grid.Process``; one whose machine was lost counts as failed."""

    ray: Any
    handle: Any

    def poll(self) -> int | None:
        """See ``Process``."""
        return self._code(0)

    def terminate(self) -> None:
        """See ``Process``."""
        self.ray.cancel(self.handle)

    def wait(self) -> int:
        """See ``Process``."""
        code = self._code(STOPPING_S)
        return 1 if code is None else code

    def _code(self, seconds: float) -> int | None:
        done, _ = self.ray.wait([self.handle], timeout=seconds)
        try:
            return int(self.ray.get(self.handle)) if done else None
        except self.ray.exceptions.RayError:
            return 1


def _do(task: str, log: str) -> int:
    """Runs on a worker: a process of its own, so that a run may be told to stop."""
    process = start_process(Path(task), Path(log))
    try:
        while (code := process.poll()) is None:  # a wait would not hear that it is cancelled
            time.sleep(POLL_S)
        return code
    except BaseException:  # cancelled
        process.terminate()
        process.wait()
        raise
