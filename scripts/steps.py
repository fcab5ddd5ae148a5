"""Steps that are done once: each is stamped with a hash of its inputs when it is through.

Knows nothing of what the steps do.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

BEGUN = "begun\n"
"""What a stamp says while its step is under way: after an interruption it still stands there."""


class SetupError(Exception):
    """Why the set-up cannot go on, in one sentence that says what to do."""


@dataclass(frozen=True)
class Step:
    """One step of the set-up.

    Attributes:
        title: What the user reads while it runs.
        stamp: File inside what the step makes, so that it goes when that is deleted.
        inputs: Files, folders (all files in them) and plain words that decide the result.
        run: Does it; raises SetupError when it cannot and has left nothing half-done.
    """

    title: str
    stamp: Path
    inputs: Sequence[Path | str]
    run: Callable[[], None]

    def interrupted(self) -> bool:
        """Whether an earlier run began this step and neither ended it nor failed."""
        return self.stamp.exists() and self.stamp.read_text() == BEGUN

    def ensure(self, tell: Callable[[str], None]) -> bool:
        """Runs the step unless it is done with the inputs as they are now.

        Args:
            tell: Gets the step's title when it starts.

        Returns:
            Whether it ran.

        Raises:
            SetupError: The step could not be done.
        """
        # Taken before the run: an input that changes meanwhile makes the step run again.
        wanted = digest(self.inputs)
        if self.stamp.exists() and self.stamp.read_text() == wanted:
            return False
        tell(self.title)
        self._write(BEGUN)
        try:
            self.run()
        except SetupError:
            self.stamp.unlink(missing_ok=True)
            raise
        self._write(wanted)
        return True

    def _write(self, text: str) -> None:
        self.stamp.parent.mkdir(parents=True, exist_ok=True)
        self.stamp.write_text(text)


def digest(inputs: Iterable[Path | str]) -> str:
    """Hashes names and contents of the inputs, byte code apart.

    Args:
        inputs: Files, folders and plain words. A path that does not exist counts as absent, not
            as an error, so that its later arrival changes the digest.

    Returns:
        Hexadecimal SHA-256.
    """
    total = hashlib.sha256()
    for item in inputs:
        if isinstance(item, str):
            total.update(f"word\0{item}\0".encode())
            continue
        files = [item] if item.is_file() else sorted(p for p in item.rglob("*") if p.is_file())
        for path in files:
            if "__pycache__" not in path.parts:
                content = hashlib.sha256(path.read_bytes()).hexdigest()
                total.update(f"file\0{path}\0{content}\0".encode())
    return total.hexdigest()
