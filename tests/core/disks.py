"""A disk that fills."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from contextlib import contextmanager

AGAIN = r"^found no way to write \S+ \(.*\); make room and run the same command again$"


@contextmanager
def full_disk(most: int) -> Iterator[None]:
    """The kernel refuses to write files beyond so many bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
