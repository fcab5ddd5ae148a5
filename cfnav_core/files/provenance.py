"""Hashes of files, which commit is running, and a note beside a file that says what it was made of.

Data are told apart by what they are (hashes of arrays) and by declared versions, never by the
source text that made them: code may be put in order without making data again.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
from pathlib import Path

from cfnav_core.files.json_file import write_json


def commit() -> str:
    """Commit of the source tree, marked when it has changes, "unknown" outside a checkout."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def sha256(path: Path) -> str:
    """Of a file, as hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def sign(path: Path, source: str) -> None:
    """Note beside a file what it was made of.

    Raises:
        WriteError: the note cannot be written.
    """
    write_json(note_of(path), {"source": source})


def made_by(path: Path) -> str:
    """What made a file; "unknown" without a note, empty where there is no file."""
    if not path.exists():
        return ""
    note = note_of(path)
    return str(json.loads(note.read_text())["source"]) if note.exists() else "unknown"


def note_of(path: Path) -> Path:
    """The file of ``sign``."""
    return path.with_suffix(".made_by.json")
