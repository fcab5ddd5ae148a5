"""The camera pictures of a drive that are worth showing, as small JPEG files. Pure."""

from __future__ import annotations

import io
from collections.abc import Container, Mapping, Sequence

import numpy as np
from PIL import Image

from cfnav_ros.bags.drives import Drive
from cfnav_ros.bags.outcomes import OBSERVABLE, contacts_of
from cfnav_ros.bags.replay_step import ReplayStep
from cfnav_ros.bags.scores import disagreements

FRAMES = 8
"""Pictures of the course of each drive."""

MOMENTS = 4
"""Further pictures of each drive: of the surest disagreements with what was driven."""

SIDE = 300
"""Of a picture's longer side, pixels: what the camera of the demo gives."""

MOST = 2000
"""Pictures kept while a drive lasts; of a longer one the oldest are lost."""


class Film:
    """Keeps the pictures that decisions were taken on until their drive is over."""

    def __init__(self) -> None:
        self._kept: dict[int, tuple[int, bytes]] = {}

    def add(self, stamp_ns: int, t_ns: int, rgb: np.ndarray) -> None:
        """A decision was taken at a time (``clocks``) on a picture, uint8 [H, W, 3]."""
        if stamp_ns in self._kept:
            return
        if len(self._kept) >= MOST:
            self._kept.pop(next(iter(self._kept)))
        self._kept[stamp_ns] = t_ns, _jpeg(rgb)

    def cut(self, drive: Drive, steps: Sequence[ReplayStep] = ()) -> Mapping[int, bytes]:
        """The pictures of a finished drive that are worth showing; those before it are dropped.

        Args:
            drive: that is over.
            steps: answers of the bundles to its decisions.
        """
        inside = {ns: kept for ns, kept in self._kept.items() if kept[0] <= drive.end_ns}
        for ns in inside:
            del self._kept[ns]
        asked = {ns: t_ns for ns, (t_ns, _) in inside.items()}
        chosen = {*key_stamps(drive, asked), *moment_stamps(steps, inside)}
        return {ns: inside[ns][1] for ns in sorted(chosen)}


def key_stamps(drive: Drive, asked: Mapping[int, int], count: int = FRAMES) -> list[int]:
    """Choose the pictures worth showing.

    First and last, those before each collision, those of vetoed decisions, that of the most
    probable collision; the rest evenly spaced.

    Args:
        drive: a finished drive.
        asked: when each picture was decided on, nanoseconds, by its stamp.
        count: of those to choose.
    """
    stamps = sorted(asked, key=lambda ns: asked[ns])
    if len(stamps) <= count:
        return stamps
    times, last = np.array([asked[ns] for ns in stamps]), len(stamps) - 1
    found = contacts_of(drive)
    contacts = found.get("truth", found.get(OBSERVABLE, ()))
    chosen = {int(np.searchsorted(times, c.t_ns, side="right")) - 1 for c in contacts}
    place = {ns: k for k, ns in enumerate(stamps)}
    shown = [d for d in drive.decisions if d.image_ns in place]
    if shown:
        chosen.add(place[max(shown, key=lambda d: d.collision_probability).image_ns])
    chosen |= {place[d.image_ns] for d in shown if d.vetoed}
    chosen = {0, last, *sorted(chosen - {-1, 0, last})[: count - 2]}
    for k in np.linspace(0, last, count).round().astype(int):
        if len(chosen) < count:
            chosen.add(int(k))
    return [stamps[k] for k in sorted(chosen)]


def moment_stamps(
    steps: Sequence[ReplayStep], stamps: Container[int], count: int = MOMENTS
) -> list[int]:
    """Choose the pictures on which bundles would surest have done something else, surest first.

    Args:
        steps: answers of the bundles to the decisions of one drive.
        stamps: of its pictures, nanoseconds.
        count: of those to choose, whichever bundles disagree.
    """
    shown = [step for step in steps if step.image_ns in stamps]
    return list(dict.fromkeys(s.image_ns for s in disagreements(shown, len(shown))))[:count]


def _jpeg(rgb: np.ndarray) -> bytes:
    picture = Image.fromarray(np.ascontiguousarray(rgb))
    picture.thumbnail((SIDE, SIDE))
    buffer = io.BytesIO()
    picture.save(buffer, format="JPEG", quality=80)
    return buffer.getvalue()
