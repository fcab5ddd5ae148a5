"""Samples of a stream of any length in bounded memory. Pure."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

MOST = 20_000
"""Samples kept of a kind; then every other goes, and the next are kept half as often. At 0.2 m/s
that is more than half an hour of poses."""

T = TypeVar("T")


class Thinned(Generic[T]):
    """Samples of which each differs from the one before; the newest is always there."""

    def __init__(self, differ: Callable[[T, T, float], bool], most: int = MOST) -> None:
        """Keep nothing yet.

        Args:
            differ: whether two samples differ, and by more than the usual times the third argument.
            most: samples kept, beside those that are pinned.
        """
        self._differ, self._most = differ, most
        self._kept: list[tuple[T, bool]] = []
        self._spacing = 1.0
        self.newest: T | None = None

    def take(self, sample: T, pin: bool = False) -> None:
        """Take the next sample; one that is pinned stays for good, and so does the one before."""
        before, self.newest = self.newest, sample
        if pin and before is not None:
            if self._kept and self._kept[-1][0] is before:
                self._kept.pop()
            self._kept.append((before, True))
        if pin or not self._kept or self._differ(self._kept[-1][0], sample, self._spacing):
            self._kept.append((sample, pin))
        if len(self._kept) > self._most:
            self._kept = [kept for i, kept in enumerate(self._kept) if kept[1] or i % 2 == 0]
            self._spacing *= 2.0

    def all(self) -> list[T]:
        """What is kept, in order, and the newest."""
        kept = [sample for sample, _ in self._kept]
        if self.newest is not None and kept[-1] is not self.newest:
            kept.append(self.newest)
        return kept
