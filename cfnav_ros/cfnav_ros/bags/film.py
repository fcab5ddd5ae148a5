"""The camera pictures of a drive that are worth showing, as small JPEG files. Pure."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence

import cv2
import numpy as np

from cfnav_ros.bags.judge.drive_log import Drive
from cfnav_ros.bags.judge.outcomes import counted_contacts
from cfnav_ros.bags.replay.scores import disagreements
from cfnav_ros.bags.replay.step import ReplayStep

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


def key_stamps(drive: Drive, asked: Mapping[int, int]) -> list[int]:
    """Choose the ``FRAMES`` pictures of its course that are worth showing.

    First and last, those before each collision, those of vetoed decisions, that of the most
    probable collision; the rest evenly spaced.

    Args:
        drive: a finished drive.
        asked: when each picture was decided on, nanoseconds, by its stamp.
    """
    stamps = sorted(asked, key=lambda ns: asked[ns])
    if len(stamps) <= FRAMES:
        return stamps
    times, last = np.array([asked[ns] for ns in stamps]), len(stamps) - 1
    contacts = [contact.t_ns for contact in counted_contacts(drive)]
    chosen = set((np.searchsorted(times, contacts, side="right") - 1).tolist())
    place = {ns: k for k, ns in enumerate(stamps)}
    shown = [d for d in drive.decisions if d.image_ns in place]
    if shown:
        chosen.add(place[max(shown, key=lambda d: d.collision_probability).image_ns])
    chosen |= {place[d.image_ns] for d in shown if d.vetoed}
    chosen = {0, last, *sorted(chosen - {-1, 0, last})[: FRAMES - 2]}
    for k in np.linspace(0, last, FRAMES).round().astype(int):
        if len(chosen) < FRAMES:
            chosen.add(int(k))
    return [stamps[k] for k in sorted(chosen)]


def moment_stamps(steps: Sequence[ReplayStep], stamps: Container[int]) -> list[int]:
    """Choose the pictures on which any bundle would surest have done something else, surest first.

    Args:
        steps: answers of the bundles to the decisions of one drive.
        stamps: of its pictures, nanoseconds.
    """
    shown = [step for step in steps if step.image_ns in stamps]
    return list(dict.fromkeys(s.image_ns for s in disagreements(shown, len(shown))))[:MOMENTS]


def _jpeg(rgb: np.ndarray) -> bytes:
    height, width = rgb.shape[:2]
    shrink = min(SIDE / max(height, width), 1.0)
    size = max(round(width * shrink), 1), max(round(height * shrink), 1)
    small = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
    _, file = cv2.imencode(".jpg", small[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 80])
    return file.tobytes()
