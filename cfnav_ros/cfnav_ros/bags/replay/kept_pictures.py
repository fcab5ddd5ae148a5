"""The pictures of the last seconds of a bag, undecoded, and no more than a fixed size. Pure."""

from __future__ import annotations

from collections import OrderedDict

from cfnav_ros.bags.files.events import Picture

KEEP_NS = 10_000_000_000
"""A live decision may take so long (``EpisodeLimits.think_timeout``)."""

MOST_BYTES = 128 << 20
"""Ten seconds of the preview camera are 30 to 60 MB; of larger pictures fewer are kept."""

MOST_PICTURES = 1000


class KeptPictures:
    """Finds a picture by its stamp.

    Attributes:
        newest: node time at which the newest picture came, and the picture; None before the first.
    """

    def __init__(self) -> None:
        self.newest: tuple[int, Picture | None] = (0, None)
        self._kept: OrderedDict[int, tuple[int, Picture]] = OrderedDict()
        self._bytes = 0

    def add(self, picture: Picture, now_ns: int) -> None:
        """Keep a picture that came at a node time; of two with one stamp the later one."""
        if picture.t_ns in self._kept:
            self._drop(picture.t_ns)
        self.newest = self._kept[picture.t_ns] = (now_ns, picture)
        self._bytes += _size(picture)
        while self._too_many(now_ns):
            self._drop(next(iter(self._kept)))

    def get(self, stamp_ns: int) -> Picture | None:
        """The picture with a stamp, None when it is not among those that are kept."""
        found = self._kept.get(stamp_ns)
        return found[1] if found else None

    def _too_many(self, now_ns: int) -> bool:
        if len(self._kept) <= 1:
            return False
        came_ns, _ = next(iter(self._kept.values()))
        many = self._bytes > MOST_BYTES or len(self._kept) > MOST_PICTURES
        return many or abs(now_ns - came_ns) > KEEP_NS

    def _drop(self, stamp_ns: int) -> None:
        _, picture = self._kept.pop(stamp_ns)
        self._bytes -= _size(picture)


def _size(picture: Picture) -> int:
    data = picture.data
    return len(data) if isinstance(data, bytes) else data.nbytes
