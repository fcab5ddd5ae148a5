"""A results folder that has its name only when everything in it is written. Knows no ROS."""

from __future__ import annotations

import fcntl
import os
import shutil
from pathlib import Path

from cfnav_core.command import CannotError


class FolderInUseError(CannotError):
    """Another run writes into the same folder; the text is one sentence."""


class RunFolder:
    """Collects results in ``<path>.partial`` and gives them the name ``path`` at the end.

    Use as a context manager; ``finish`` inside it makes the results good. Without it the partial
    folder stays, with the logs in it, until the next run for the same path begins.
    """

    def __init__(self, path: Path) -> None:
        """Only remember the path."""
        self.path = path
        self.partial = path.with_name(path.name + ".partial")

    def __enter__(self) -> RunFolder:
        """Make an empty partial folder.

        Raises:
            FolderInUseError: another process is writing into it.
        """
        self.partial.mkdir(parents=True, exist_ok=True)
        self._lock = os.open(self.partial, os.O_RDONLY)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(self._lock)
            raise FolderInUseError(
                f"another run is writing {self.partial}; wait for it or choose another --out"
            ) from None
        for entry in self.partial.iterdir():
            shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
        return self

    def __exit__(self, *_: object) -> None:
        """Let other runs use the folder again."""
        os.close(self._lock)

    def finish(self) -> None:
        """Replace the results of an earlier run by these."""
        old = self.path.with_name(self.path.name + ".old")
        shutil.rmtree(old, ignore_errors=True)
        if self.path.exists():
            self.path.rename(old)
        self.partial.rename(self.path)
        shutil.rmtree(old, ignore_errors=True)
