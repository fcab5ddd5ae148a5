"""Published HDF5 files: one dataset per state at the root, named by the state's key."""

from __future__ import annotations

import io
from contextlib import closing
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from cfnav_core.files.whole import writing
from cfnav_core.published.graph import Keys
from cfnav_core.published.keys import Key
from cfnav_core.scenes.scene import SceneError


class StateFile:
    """An open file, read state by state.

    Attributes:
        names: key to dataset name.
        bad: dataset names that are no usable keys, with why.

    Raises:
        SceneError: it is missing, truncated or no HDF5.
        ModuleNotFoundError: h5py is not installed.
    """

    def __init__(self, path: Path) -> None:
        import h5py  # belongs to training: a robot has none

        self.path = path
        try:
            self._file = h5py.File(path, "r", locking=False)  # also on read-only shares
            texts = list(self._file)
        except (OSError, RuntimeError) as error:
            raise SceneError(
                f"found no readable {path} ({error}); download or unpack it again"
            ) from error
        keys = Keys()
        # sorted, -0.00 comes before 0.00, which wins where a file has both
        read = {text: keys.read(text) for text in sorted(texts)}
        self.names = {key: text for text, key in read.items() if key is not None}
        self.bad = keys.bad

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def shape(self, key: Key) -> tuple[int, ...]:
        """Shape of a state's numbers, which are not read."""
        return tuple(self._dataset(key).shape)

    def read(self, key: Key) -> np.ndarray:
        """Numbers of a state.

        Raises:
            SceneError: they are damaged.
        """
        dataset = self._dataset(key)
        try:
            return np.asarray(dataset[()])
        except (OSError, RuntimeError) as error:
            raise SceneError(f"found unreadable numbers ({error}); download them again") from error

    def _dataset(self, key: Key) -> Any:
        try:
            dataset = self._file[self.names[key]]
        except (OSError, RuntimeError, KeyError) as error:
            raise SceneError(f"found unreadable numbers ({error}); download them again") from error
        if not hasattr(dataset, "shape"):
            raise SceneError("found an HDF5 group, expected a dataset; download the file again")
        return dataset


class StateWriter:
    """A new file, written state by state.

    Args:
        path: of the file; what is there is replaced.

    Raises:
        WriteError: from any method, and at the end of the block: the disk is full or refuses.
        ModuleNotFoundError: h5py is not installed.
    """

    def __init__(self, path: Path) -> None:
        import h5py  # belongs to training: a robot has none

        self.path = path
        with writing(path):
            self._disk = _Disk(path, "w+")
        self._file = h5py.File(self._disk, "w")

    def __enter__(self) -> Self:
        """The writer itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        """Close the file."""
        with closing(self._disk):
            self._file.close()
        if error is None:
            self._check()

    def add(self, key: Key, numbers: np.ndarray) -> None:
        """Write the numbers of a state."""
        self._file.create_dataset(str(key), data=numbers)
        self._check()

    def _check(self) -> None:
        with writing(self.path):
            if self._disk.failure:
                raise self._disk.failure


class _Disk(io.FileIO):
    """Remembers that the disk refused, and goes on: HDF5 that cannot write ends in a crash."""

    failure: OSError | None = None

    def write(self, data: Any) -> int:
        rest = memoryview(data).cast("B")
        try:
            while rest:
                rest = rest[super().write(rest) :]
        except OSError as error:
            self.failure = error
        return len(data)

    def truncate(self, size: int | None = None) -> int:
        try:
            return super().truncate(size)
        except OSError as error:
            self.failure = error
            return size or 0
