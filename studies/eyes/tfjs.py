"""Constants of a TensorFlow.js graph as it lies in a package."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np


def weights(folder: Path, manifest: list[dict[str, Any]]) -> dict[str, np.ndarray]:
    """Every constant of a graph by its name; halves become floats again."""
    found: dict[str, np.ndarray] = {}
    for group in manifest:
        data = b"".join((folder / part).read_bytes() for part in group["paths"])
        at = 0
        for entry in group["weights"]:
            stored = np.dtype(entry.get("quantization", entry)["dtype"])
            count = int(np.prod(entry["shape"]))
            flat = np.frombuffer(data, stored, count, at)
            found[entry["name"]] = flat.astype(entry["dtype"]).reshape(entry["shape"])
            at += count * stored.itemsize
    return found
