"""Files and folders that appear only when complete, and what to say when they cannot be written."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class WriteError(OSError):
    """Something cannot be written; the message names it and says what to do."""


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Say in one sentence that ``path`` cannot be written; only writing happens in this block.

    Raises:
        WriteError: the disk is full or refuses.
    """
    try:
        yield
    except OSError as error:
        raise WriteError(
            f"found no way to write {path} ({error}); make room and run the same command again"
        ) from error


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Give a name beside ``path`` to make a file or folder at; it takes its place at the end.

    When the block fails, what was at ``path`` stays and what was begun is removed. A folder steps
    aside for the new one; a kill between the two is mended by the next call.
    """
    partial = path.with_name(path.name + ".partial")
    aside = path.with_name(f".{path.name}.before")  # a name that nobody gives to what is theirs
    _bring_back(aside, path)
    remove(partial)
    try:
        yield partial
        if partial.is_dir() and path.exists():
            remove(aside)
            path.replace(aside)
        partial.replace(path)
    except BaseException:
        _bring_back(aside, path)
        raise
    finally:
        remove(partial)
    if aside.is_dir():
        remove(aside)


def _bring_back(aside: Path, path: Path) -> None:
    if aside.is_dir() and not path.exists():
        aside.replace(path)


def write_file(path: Path, content: bytes | str) -> None:
    """Write a file, making its folder; text as UTF-8.

    Bytes of file names that are no UTF-8 are written as escapes.

    Raises:
        WriteError: the disk is full or refuses; what was there before stays whole.
    """
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as partial:
            if isinstance(content, str):
                content = content.encode(errors="backslashreplace")
            partial.write_bytes(content)


def remove(path: Path) -> None:
    """Remove a file or a folder, where there is one."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
