"""Figures on disk."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from cfnav_core.files.whole import write_file


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write figures, making the folder; the file appears only when complete.

    What is not finite, as a mean of nothing, is written as null: JSON has no such numbers.

    Raises:
        WriteError: the disk is full or refuses; what was there before stays whole.
    """
    write_file(path, json.dumps(_plain(content), indent=1, allow_nan=False) + "\n")


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(of) for key, of in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(of) for of in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
