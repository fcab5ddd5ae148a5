"""Steps that are done once: each is stamped with a hash of its inputs when it is through.

A step that was interrupted is never taken for done: a marker is written before it starts and goes
only when its stamp stands. The next run finds the marker and calls the step's `undo` first.
Knows nothing of what the steps do.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

IGNORED_PARTS = {"__pycache__", ".pytest_cache"}


class SetupError(Exception):
    """Why the set-up cannot go on, in one sentence that says what to do."""


@dataclass(frozen=True)
class Step:
    """One step of the set-up.

    Attributes:
        name: Name of the stamp.
        title: What the user reads while it runs.
        product: A file that exists when the step is through; without it the stamp does not count.
        inputs: Files, folders (all files in them) and plain words that decide the result.
        run: Does it; raises SetupError when it cannot and has left nothing half-done.
        undo: Removes what an interrupted run may have left half-done.
    """

    name: str
    title: str
    product: Path
    inputs: Sequence[Path | str]
    run: Callable[[], None]
    undo: Callable[[], None]


def digest(inputs: Iterable[Path | str]) -> str:
    """Hashes names and contents of the inputs.

    Args:
        inputs: Files, folders and plain words. A path that does not exist counts as absent, not
            as an error, so that its later arrival changes the digest.

    Returns:
        Hexadecimal SHA-256.
    """
    total = hashlib.sha256()
    for item in inputs:
        if isinstance(item, str):
            total.update(b"word\0" + item.encode() + b"\0")
            continue
        files = [item] if item.is_file() else sorted(p for p in item.rglob("*") if p.is_file())
        for path in files:
            if IGNORED_PARTS.isdisjoint(path.parts):
                content = hashlib.sha256(path.read_bytes()).digest()
                total.update(b"file\0" + str(path).encode() + b"\0" + content)
    return total.hexdigest()


def write_whole(path: Path, text: str) -> None:
    """Writes a file so that it is either old or new, never half."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".partial")
    temporary.write_text(text)
    temporary.replace(path)


class Stamps:
    """The stamps of one checkout, kept as small files in one folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    @property
    def _marker(self) -> Path:
        return self._folder / "in-progress"

    def is_done(self, step: Step) -> bool:
        """Whether the step is through, with the inputs as they are now."""
        stamp = self._folder / f"{step.name}.stamp"
        if not stamp.exists() or not step.product.exists():
            return False
        return stamp.read_text().strip() == digest(step.inputs)

    def recover(self, steps: Iterable[Step]) -> Step | None:
        """Undoes the step that an earlier run began and never finished.

        Args:
            steps: All steps that may have been under way.

        Returns:
            The step that was undone, or None when the last run ended properly.
        """
        if not self._marker.exists():
            return None
        name = self._marker.read_text().strip()
        step = next((s for s in steps if s.name == name), None)
        if step is not None:
            step.undo()
        self._marker.unlink()
        return step

    def ensure(self, step: Step, tell: Callable[[str], None]) -> bool:
        """Runs the step unless it is done.

        Args:
            step: The step.
            tell: Gets the step's title when it starts.

        Returns:
            Whether the step ran.

        Raises:
            SetupError: The step could not be done.
        """
        if self.is_done(step):
            return False
        tell(step.title)
        # Taken before the run: an input that changes meanwhile makes the step run again.
        stamp = digest(step.inputs)
        (self._folder / f"{step.name}.stamp").unlink(missing_ok=True)
        write_whole(self._marker, step.name + "\n")
        try:
            step.run()
        except SetupError:
            self._marker.unlink(missing_ok=True)
            raise
        write_whole(self._folder / f"{step.name}.stamp", stamp + "\n")
        self._marker.unlink()
        return True
