"""Paths -> bags: which files and folders are one bag, and what it is called."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from cfnav_core.command import CannotError
from cfnav_ros.bags.files.metadata import METADATA

SUFFIXES = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")

FileId = tuple[int, int]
"""Device and number of a file: the same by whichever name it is reached."""


class BagError(CannotError):
    """There is no bag; the text is one sentence."""


def find_bags(paths: Iterable[Path]) -> list[Path]:
    """Find the bags in files and folders.

    Args:
        paths: bags (a folder with ``metadata.yaml`` or storage files, or one such file), or
            folders to be searched.

    Returns:
        The bags in the order of the paths, those within one sorted by name, each once, however many
        links lead to it: a folder, a file, or for one of several bags of a folder that is split
        ``NAME_*.mcap``.

    Raises:
        BagError: a path does not exist, or holds no bag.
    """
    found: dict[frozenset[FileId], Path] = {}
    for path in paths:
        if not path.exists():
            if path.is_symlink():
                raise BagError(f"{path} is a link to {path.readlink()}, which is not there.")
            raise BagError(f"{path} does not exist, expected a bag or a folder with bags.")
        single = path.is_file() and path.name.endswith(SUFFIXES)
        bags = _bags_in(path, set()) if path.is_dir() else [path] * single
        if not bags:
            raise BagError(
                f"{path} is no bag and holds none: expected {METADATA}, {' or '.join(SUFFIXES)}."
            )
        for bag in bags:
            found.setdefault(_files_of(bag), bag)
    return list(found.values())


def _file_id(path: Path) -> FileId:
    about = path.stat()
    return about.st_dev, about.st_ino


def _files_of(bag: Path) -> frozenset[FileId]:
    """The storage files of a bag; of one that lacks them the folder."""
    split = not bag.exists()
    folder = bag.parent if split else bag
    if bag.is_file():
        return frozenset([_file_id(bag)])
    files = folder.iterdir() if os.access(folder, os.R_OK) else ()
    names = packed_once(path.name for path in files)
    mine = [folder / name for name in names if not split or all_parts(name) == bag.name]
    found = [_file_id(path) for path in mine if path.exists()]
    return frozenset(found or [_file_id(folder)])


def unique_names(bags: Sequence[Path]) -> list[str]:
    """Name each bag by as much of the end of its path as tells it from the others.

    Args:
        bags: different ones.
    """
    parts = [path.absolute().parts for path in bags]
    names = []
    for mine in parts:
        others = [other for other in parts if other != mine]
        ends = range(1, len(mine) + 1)
        size = next(n for n in ends if all(other[-n:] != mine[-n:] for other in others))
        names.append(str(Path(*mine[-size:])))
    return names


def _bags_in(folder: Path, seen: set[FileId]) -> list[Path]:
    """The bags in a folder; one with metadata is a bag itself and is not searched further.

    Links are followed after everything else, and only to folders that were not ``seen``.
    """
    bags, links = [], []
    for here, folders, files in os.walk(folder):
        folders.sort(key=natural)
        seen.add(_file_id(Path(here)))
        if METADATA in files:
            bags.append(Path(here))
            folders.clear()
            continue
        links += [path for name in folders if (path := Path(here, name)).is_symlink()]
        groups: dict[str, list[str]] = {}
        for name in sorted(packed_once(files), key=natural):
            groups.setdefault(all_parts(name), []).append(name)
        if len(groups) == 1 and not folders:  # the folder of a bag that lacks its metadata
            bags.append(Path(here))
            continue
        for pattern, names in groups.items():
            bags.append(Path(here, names[0] if len(names) == 1 else pattern))
    for link in links:
        if _file_id(link) not in seen:
            bags += _bags_in(link, seen)
    return bags


def packed_once(names: Iterable[str]) -> set[str]:
    """The storage files among names, without those that somebody has unpacked beside them."""
    here = {name for name in names if name.endswith(SUFFIXES)}
    return here - {f"{name}.zstd" for name in here}


def all_parts(name: str) -> str:
    """``NAME_*.mcap`` for a file that is named as a part of a split bag, else its own name."""
    whole = name.removesuffix(".zstd")
    return re.sub(r"_\d+(?=\.(mcap|db3)$)", "_*", whole)


def natural(name: str) -> list[tuple[int, str]]:
    """A sorting key that puts part 10 behind part 9."""
    return [(int(digits or 0), text) for text, digits in re.findall(r"(\D*)(\d*)", name)]
