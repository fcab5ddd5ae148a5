"""What studies ask of a policy that walks frozen episodes in scenes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class PolicyInScenes:
    """A policy, and the episodes that it walks."""

    policy: Annotated[Path, tyro.conf.Positional]
    """A bundle, or a checkpoint such as best.safetensors."""
    scenes: Path
    """Folder of scenes (cfnav rooms make, cfnav rooms boxes)."""
    rooms: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """TYPE:SEED, TYPE:FIRST-LAST or a split, given as often as needed; all when absent."""
    episodes: int = 4000
    """Frozen episodes."""
    seed: int = 0
    """Draws starts and goals."""
