"""Figures on disk."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from cfnav_core.files.whole import write_file


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write figures, making the folder; the file appears only when complete.

    Raises:
        WriteError: the disk is full or refuses; what was there before stays whole.
    """
    write_file(path, json.dumps(content, indent=1) + "\n")
