"""Identity of source code, and a note of it beside files: what other code made is made again."""

from __future__ import annotations

import ast
import hashlib
import json
import subprocess
from collections.abc import Iterable
from pathlib import Path

from cfnav_core.json_file import write_json


def source_identity(files: Iterable[Path]) -> str:
    """16 hex digits of what Python files do, the same under every version of Python.

    Comments, docstrings and layout are left out.

    Raises:
        OSError: a file cannot be read.
    """
    digest = hashlib.sha256()
    for path in files:
        tree = ast.parse(path.read_text())
        for node in ast.walk(tree):
            body = getattr(node, "body", None)
            if isinstance(body, list) and body and _is_text(body[0]):
                body.pop(0)
        digest.update(repr(_parts(tree)).encode())
    return digest.hexdigest()[:16]


def _is_text(statement: ast.stmt) -> bool:
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )


def _is_empty(value: ast.expr) -> bool:
    return isinstance(value, ast.Constant) and value.value == ""


def _parts(node: object) -> object:
    """A tree as nested tuples; empty fields are left out, as newer Pythons have more of them.

    So is the empty text at the end of a format string's nested field, which Python 3.12 adds.
    """
    if isinstance(node, ast.JoinedStr):
        parts = tuple(_parts(value) for value in node.values if not _is_empty(value))
        return ("JoinedStr", parts)
    if isinstance(node, ast.AST):
        fields = ((name, _parts(value)) for name, value in ast.iter_fields(node))
        return (type(node).__name__, *(field for field in fields if field[1] not in (None, ())))
    return tuple(map(_parts, node)) if isinstance(node, list) else node


def commit() -> str:
    """Commit of the source tree, marked when it has changes, "unknown" outside a checkout."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def sign(path: Path, source: str) -> None:
    """Note beside a file what made it.

    Raises:
        WriteError: the note cannot be written.
    """
    write_json(_note(path), {"source": source})


def made_by(path: Path) -> str:
    """What made a file; "unknown" without a note, empty where there is no file."""
    if not path.exists():
        return ""
    note = _note(path)
    return str(json.loads(note.read_text())["source"]) if note.exists() else "unknown"


def _note(path: Path) -> Path:
    return path.with_suffix(".made_by.json")
