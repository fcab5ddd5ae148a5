"""Standard output and error, whatever they are: any encoding, closed, a pipe that nobody reads."""

from __future__ import annotations

import io
import os
import sys
from typing import TextIO


class _Tolerant(io.FileIO):
    """A file that takes what nobody reads any more: ``| head`` has seen enough."""

    def write(self, data: object, /) -> int:
        """Write, or do as if."""
        try:
            return super().write(data)  # type: ignore[arg-type]
        except BrokenPipeError:
            return memoryview(data).nbytes  # type: ignore[arg-type]


def prepare_streams() -> None:
    """From now on printing fails for no character, no stream that was closed and no reader gone."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:  # the next file would take its place, and what others print
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    if sys.stdout is sys.__stdout__:
        sys.stdout = _tolerant(1, sys.stdout)
    if sys.stderr is sys.__stderr__:
        sys.stderr = _tolerant(2, sys.stderr)


def _tolerant(number: int, stream: TextIO | None) -> TextIO:
    """A stream like another (None: it was closed), by the number of its file."""
    raw = _Tolerant(number, "w", closefd=False)
    if not isinstance(stream, io.TextIOWrapper):
        buffer = io.BufferedWriter(raw)
        return io.TextIOWrapper(buffer, "utf-8", "backslashreplace", line_buffering=True)
    stream.flush()
    # PYTHONUNBUFFERED and `python -u` ask for no buffer at all.
    unbuffered = stream.write_through
    return io.TextIOWrapper(
        raw if unbuffered else io.BufferedWriter(raw),  # type: ignore[arg-type]
        stream.encoding, "backslashreplace",
        line_buffering=stream.line_buffering, write_through=unbuffered,
    )  # fmt: skip
