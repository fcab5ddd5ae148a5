"""Knowledge to and from one safetensors file, and readers of a user's own matrices."""

from __future__ import annotations

import json
from collections.abc import Collection
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from cfnav_core.files.whole import write_file
from cfnav_core.models.base import Knowledge
from cfnav_core.task.vocabulary import ROOM_TYPES

SCHEMA = 1
AGAIN = "make it from these scenes with cfnav data knowledge"
R = len(ROOM_TYPES)
SHAPES: dict[str, tuple[int | str, ...]] = {
    "words": ("C", "W"), "text": ("C", "X"), "zones": (R, "Z", "C"), "zone_edges": (R, "Z", "Z"),
    "layout": (R, "C", "C"), "adjacency": ("C", "C"), "parents": (R, "C", "C"),
}  # fmt: skip


class KnowledgeError(ValueError):
    """Knowledge cannot be read or belongs to other scenes; the message says what to do."""


@dataclass(frozen=True)
class KnowledgeHead:
    """What a file of knowledge was made from.

    Attributes:
        objects: C names, in the order of the tables.
        scenes: names of the training scenes.
        perception: identity of what made their detections.
        words: where the word vectors come from.
        seed: of the zones.
    """

    objects: tuple[str, ...]
    scenes: tuple[str, ...]
    perception: str
    words: str
    seed: int


def save_knowledge(path: Path, knowledge: Knowledge, head: KnowledgeHead) -> None:
    """Write knowledge as float32; the file appears only when complete.

    Raises:
        KnowledgeError: a table does not fit the objects.
        WriteError: the disk is full or refuses; what was there before stays whole.
    """
    tables = {k: np.ascontiguousarray(v, np.float32) for k, v in knowledge.arrays().items()}
    _check(tables, len(head.objects), path)
    text = json.dumps({"schema": SCHEMA, **asdict(head)})
    write_file(path, save(tables, {"head": text}))


def load_knowledge(
    path: Path, objects: tuple[str, ...], perception: str, scenes: Collection[str] | None = None
) -> Knowledge:
    """Read knowledge for scenes with these objects and this perception.

    Args:
        path: of the file.
        objects: of the scenes.
        perception: identity of what looked at them.
        scenes: those that train, which it may have been made from; any when None.

    Raises:
        KnowledgeError: it is missing, damaged, or made from scenes of other objects or another
            perception, or from others than those that train.
    """
    tables, head = _open(path)
    if head.objects != tuple(objects):
        raise KnowledgeError(f"found knowledge of {_difference(head.objects, objects)} at {path}; "
                             f"{AGAIN}")  # fmt: skip
    if head.perception != perception:
        raise KnowledgeError(
            f"found knowledge at {path} from detections of perception {head.perception}, but the "
            f"scenes have {perception}; {AGAIN}"
        )
    if scenes is not None and (others := sorted(set(head.scenes) - set(scenes))):
        raise KnowledgeError(
            f"found knowledge at {path} made from {others[0]} and {len(others) - 1} more that do "
            f"not train, expected none, as they may validate or test; {AGAIN}"
        )
    _check(tables, len(objects), path)
    return Knowledge(**tables)


def load_head(path: Path) -> KnowledgeHead:
    """What the knowledge in a file was made from.

    Raises:
        KnowledgeError: it is missing or damaged.
    """
    return _open(path)[1]


def _open(path: Path) -> tuple[dict[str, np.ndarray], KnowledgeHead]:
    try:
        with safe_open(path, "np") as file:
            tables = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118
            text: dict[str, Any] = json.loads((file.metadata() or {})["head"])
        schema = text.pop("schema")
        if schema == SCHEMA:
            objects, scenes = (tuple(text.pop(key)) for key in ("objects", "scenes"))
            return tables, KnowledgeHead(objects, scenes, **text)
    except (OSError, SafetensorError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise KnowledgeError(f"found no readable knowledge at {path} ({error}); {AGAIN}") from error
    raise KnowledgeError(
        f"found knowledge of schema {schema} at {path}, expected {SCHEMA}; {AGAIN}"
    )


def _difference(found: tuple[str, ...], expected: tuple[str, ...]) -> str:
    """Say how two lists of objects differ."""
    if missing := [name for name in expected if name not in found]:
        return f"{len(found)} objects without the scenes' {', '.join(missing)}"
    if more := [name for name in found if name not in expected]:
        return f"{', '.join(more)}, which the scenes do not have"
    return "the scenes' objects in another order"


def _check(tables: dict[str, np.ndarray], objects: int, path: Path) -> None:
    """Raise unless every table is known, finite, and has the shape that the others give it."""
    if unknown := sorted(set(tables) - {f.name for f in fields(Knowledge)}):
        raise KnowledgeError(f"found unknown tables {', '.join(unknown)} in {path}, "
                             f"expected some of {', '.join(SHAPES)}")  # fmt: skip
    sizes: dict[str, int] = {"C": objects}
    for name, table in tables.items():
        fits = table.ndim == len(SHAPES[name]) and all(
            n == (sizes.setdefault(m, n) if isinstance(m, str) else m)
            for n, m in zip(table.shape, SHAPES[name], strict=True)
        )
        if not fits:
            expected = ", ".join(str(sizes.get(str(m), m)) for m in SHAPES[name])
            raise KnowledgeError(f"found {name} of shape {table.shape} in {path}, expected "
                                 f"({expected}); {AGAIN}")  # fmt: skip
        if not np.isfinite(table).all():
            raise KnowledgeError(f"found numbers in {name} of {path} that are not finite; "
                                 f"{AGAIN}")  # fmt: skip


def read_matrix(path: Path, objects: int, square: bool = False) -> np.ndarray:
    """Read a user's own table with one row for each object, from .npy or a text file.

    Args:
        path: the file; text has one row a line, numbers parted by spaces or commas.
        objects: C, the number of rows.
        square: expect [C, C] of 0 and 1, as links between objects.

    Returns:
        float32 [C, X].

    Raises:
        KnowledgeError: it cannot be read or has another shape or other numbers.
    """
    try:
        if path.suffix == ".npy":
            table = np.load(path, allow_pickle=False)
        else:
            table = np.loadtxt(path.read_text().replace(",", " ").splitlines(), ndmin=2)
        table = np.asarray(table, np.float32)
    except (OSError, EOFError, ValueError, TypeError) as error:
        raise KnowledgeError(
            f"found no readable matrix at {path} ({error}); give a .npy file, or text with one row "
            "a line"
        ) from error
    expected = f"({objects}, {objects})" if square else f"({objects}, any)"
    if table.ndim != 2 or len(table) != objects or (square and table.shape[1] != objects):
        raise KnowledgeError(f"found a matrix of shape {table.shape} in {path}, expected {expected}"
                             ": one row for each object of the scenes, in their order")  # fmt: skip
    if not np.isfinite(table).all() or (square and not np.isin(table, (0, 1)).all()):
        raise KnowledgeError(f"found other numbers in {path} than expected: "
                             + ("only 0 and 1" if square else "all finite"))  # fmt: skip
    return table
