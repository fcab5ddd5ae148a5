"""Word vectors of object names: a small shipped table, and readers for GloVe (``glove.py``).

The table was made once by ``make.py`` with a sentence encoder that is no dependency of this
package. Names are class names (``CoffeeMachine``) or plain words (``coffee machine``).

May import: cfnav_core.detect, cfnav_core.files, cfnav_core.task, cfnav_core.scenes.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from safetensors import SafetensorError, safe_open

TABLE = Path(__file__).with_name("minilm.safetensors")
"""float16 [N, 384] ``vectors``; the head names the encoder and the N names in plain words."""

RESPELLED = {"Glassbottle": "glass bottle"}
"""Class names whose capitals do not show their words."""

_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")


class WordError(ValueError):
    """A name has no word vector, or a table cannot be read; the message says what to do."""


def plain(name: str) -> str:
    """A class name in plain words: ``CoffeeMachine`` to ``coffee machine``."""
    return RESPELLED.get(name) or " ".join(_WORD.findall(name)).lower()


def vectors(names: Sequence[str], path: Path = TABLE) -> np.ndarray:
    """Word vectors from the shipped table.

    Args:
        names: N object names.
        path: another table that ``make.py`` wrote.

    Returns:
        float32 [N, 384] of unit length.

    Raises:
        WordError: a name is not in the table, or there is no such table.
    """
    rows, table = _table(path)
    if missing := [n for n in names if plain(n) not in rows]:
        raise WordError(
            f"found no word vector for {', '.join(missing)} in {path.name}, which has {len(rows)} "
            "names; add them with cfnav data words or give a GloVe file"
        )
    found = table[[rows[plain(n)] for n in names]]
    return found / np.linalg.norm(found, axis=1, keepdims=True)


@cache
def _table(path: Path) -> tuple[dict[str, int], np.ndarray]:
    try:
        with safe_open(path, "np") as file:
            table = file.get_tensor("vectors").astype(np.float32)
            names = json.loads((file.metadata() or {})["head"])["names"]
    except (OSError, SafetensorError, KeyError, ValueError) as error:
        raise WordError(
            f"found no readable word table at {path} ({error}); make one with cfnav data words"
        ) from error
    return {name: row for row, name in enumerate(names)}, table
