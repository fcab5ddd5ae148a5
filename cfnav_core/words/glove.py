"""GloVe vectors of object names, from the plain text files or from a published data set's HDF5.

The vectors are given as they are in the file (not of unit length), as the published models read
them. A name of several words gets the mean of its words' vectors.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cfnav_core.words import WordError, plain


def from_file(path: Path, names: Sequence[str]) -> np.ndarray:
    """Read either kind of file, told by its ending (.hdf5 and .h5; all else is text).

    Args:
        path: the file.
        names: N object names.

    Returns:
        float32 [N, W]; W is 300 in the published files.

    Raises:
        WordError: the file cannot be read or lacks a word.
    """
    return (from_hdf5 if path.suffix in (".hdf5", ".h5") else from_text)(path, names)


def from_text(path: Path, names: Sequence[str]) -> np.ndarray:
    """Read a GloVe text file: one line for each word, ``word v1 ... vW``. See ``from_file``."""
    wanted = {word for name in names for word in plain(name).split()}
    found: dict[str, np.ndarray] = {}
    try:
        with path.open(encoding="utf-8") as lines:
            for number, line in enumerate(lines, 1):
                word, _, rest = line.rstrip().partition(" ")
                if word in wanted and word not in found:
                    found[word] = _numbers(rest, f"line {number} of {path}")
    except (OSError, UnicodeDecodeError) as error:
        raise WordError(
            f"found no readable GloVe file at {path} ({error}); give a text file of words and "
            "numbers, for example glove.6B.300d.txt"
        ) from error
    return _of_names(names, found, path)


def from_hdf5(path: Path, names: Sequence[str]) -> np.ndarray:
    """Read a published HDF5 file: one dataset for each class name. See ``from_file``.

    A class without a dataset gets the mean of its words, where the words have datasets.
    """
    try:
        import h5py
    except ImportError as error:
        raise WordError("found no h5py, which reads HDF5 files; pip install h5py") from error
    found: dict[str, np.ndarray] = {}
    try:
        with h5py.File(path, "r") as file:
            for key in {key for n in names for key in (n, *plain(n).split())} & set(file):
                found[key] = _checked(np.asarray(file[key][()], np.float32), f"{key} in {path}")
    except (OSError, TypeError, ValueError) as error:
        if isinstance(error, WordError):
            raise
        raise WordError(
            f"found no readable word vectors in {path} ({error}); give an HDF5 file with one "
            "dataset for each class name"
        ) from error
    return _of_names(names, found, path)


def _of_names(names: Sequence[str], found: dict[str, np.ndarray], path: Path) -> np.ndarray:
    if len(widths := {len(vector) for vector in found.values()}) > 1:
        raise WordError(f"found word vectors of {sorted(widths)} numbers in {path}, expected one "
                        "length; the file is damaged, fetch it again")  # fmt: skip
    keys = [[name] if name in found else plain(name).split() for name in names]
    if missing := [n for n, parts in zip(names, keys, strict=True) if not found.keys() >= {*parts}]:
        raise WordError(
            f"found no vectors for {', '.join(missing)} in {path}; "
            "give a file that has all words of all objects"
        )
    return np.stack([np.mean([found[k] for k in parts], axis=0) for parts in keys])


def _numbers(text: str, where: str) -> np.ndarray:
    try:
        return _checked(np.array(text.split(" "), np.float32), where)
    except ValueError as error:
        if isinstance(error, WordError):
            raise
        raise WordError(f"found no vector on {where} ({error}), expected numbers after the word; "
                        "the file is damaged, fetch it again") from error  # fmt: skip


def _checked(vector: np.ndarray, where: str) -> np.ndarray:
    if vector.ndim != 1 or not len(vector) or not np.isfinite(vector).all():
        raise WordError(f"found shape {vector.shape} or numbers that are not finite as {where}, "
                        "expected one finite vector; fetch the file again")  # fmt: skip
    return vector
