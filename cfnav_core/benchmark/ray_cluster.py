"""The tasks of a grid on a Ray cluster: every machine must see the grid's folder at its path."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cfnav_core.benchmark.grid import POLL_S, start_process


class RayCluster:
    """Tasks as remote functions, one CPU each."""

    def __init__(self, address: str, jobs: int) -> None:
        """Join a cluster; "local" starts one on this machine, of as many workers as ``jobs``.

        Raises:
            ValueError: Ray is not installed.
            ConnectionError: there is no cluster at the address.
        """
        try:
            import ray
        except ModuleNotFoundError as error:
            raise ValueError(
                f"found no Ray ({error}); install it with pip install 'cfnav[cluster]'"
            ) from error

        self._ray = ray
        ray.init(
            address=address, log_to_driver=False, configure_logging=False,
            num_cpus=jobs if address == "local" else None,
        )  # fmt: skip
        self.slots = int(ray.cluster_resources().get("CPU", 1))
        self._work = ray.remote(num_cpus=1, max_retries=0)(_do)

    def start(self, task: Path, log: Path) -> Any:
        """See ``Executor``."""
        return self._work.remote(str(task.resolve()), str(log.resolve()))

    def poll(self, handle: Any) -> int | None:
        """See ``Executor``; a machine that was lost counts as failed."""
        done, _ = self._ray.wait([handle], timeout=0)
        if not done:
            return None
        try:
            return self._ray.get(handle)
        except self._ray.exceptions.RayError:
            return 1

    def stop(self, handles: Sequence[Any]) -> None:
        """See ``Executor``."""
        for handle in handles:
            self._ray.cancel(handle)
        if handles:
            self._ray.wait(list(handles), num_returns=len(handles), timeout=60)

    def close(self) -> None:
        """See ``Executor``; a cluster that was started here ends."""
        self._ray.shutdown()


def _do(task: str, log: str) -> int:
    """Runs on a worker: a process of its own, so that a run may be told to stop."""
    process = start_process(Path(task), Path(log))
    try:
        while process.poll() is None:  # a wait would not hear that it is cancelled
            time.sleep(POLL_S)
        return process.returncode
    except BaseException:  # cancelled
        process.terminate()
        process.wait()
        raise
