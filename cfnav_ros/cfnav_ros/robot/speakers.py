"""Who speaks: every input that a drive's safety hangs on comes from one publisher. Pure.

A publisher is known by its GID, which the middleware gives to each and no ROS publisher can choose;
names can be had twice. From one drive to the next GIDs change, as nodes and drivers start anew, and
only a name can be expected to stay.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

GUARDED = ("frame", "estimate", "odometry", "hazards", "scan")
"""What safety hangs on: fields of ``SensorInputs`` and names of ``diagnostics.STATUSES``; ``scan``
is what the estimates are made from."""


UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"
"""What discovery says of an endpoint whose node it has not heard of yet."""


@dataclass(frozen=True)
class Speaker:
    """A publisher of a topic: its GID and the name of its node."""

    gid: bytes
    node: str


class OneSpeaker:
    """The one publisher of a topic: the first that is seen there alone, until ``forget``.

    Attributes:
        topic: its name, resolved.
        type: of its messages, such as sensor_msgs/msg/LaserScan.
    """

    def __init__(self, topic: str, type: str) -> None:
        self.topic, self.type = topic, type
        self._known: Speaker | None = None
        self._trusted = ""

    def forget(self) -> None:
        """Another one may speak from now on, of the name that was trusted."""
        self._known = None

    def trust(self) -> None:
        """The robot drives by what the known one says: another name must not stand in for it."""
        if self._known is not None and self._known.node != UNKNOWN_NODE:
            self._trusted = self._known.node

    def look(self, speakers: Sequence[Speaker], met: int = 0) -> str:
        """One sentence when somebody else speaks, or might; else empty.

        Args:
            speakers: all publishers of the topic's type there now.
            met: how many its listener has ever met; 0 where nobody listens.
        """
        if len(speakers) > 1:
            names = ", ".join(sorted(map(_named, speakers)))
            return f"{len(speakers)} nodes publish {self.topic} ({names}): end all but one."
        for speaker in speakers:
            if self._known is not None and speaker.gid != self._known.gid:
                return f"{_named(speaker)} publishes {self.topic} now, in place of another one."
            if speaker.node == UNKNOWN_NODE:
                if self._trusted and self._known is None:
                    return f"A publisher on {self.topic} has not said its name."
                self._known = self._known or speaker
                continue
            if self._trusted and speaker.node != self._trusted:
                return (
                    f"{speaker.node} publishes {self.topic} now, {self._trusted} did in the drive "
                    "before: end it, or start the policy node again if that is meant."
                )
            self._known = speaker  # its name may be discovered later than itself
        if met > 1:
            return (
                f"Another publisher of {self.topic} came and went: whose words came meanwhile "
                "cannot be told."
            )
        return ""


class OneAfterAnother:
    """The one publisher of a topic, and after a while of silence whoever takes its place."""

    def __init__(self, topic: str, type: str, silence: float) -> None:
        """Begin without one; ``silence`` is in real seconds, the rest as of ``OneSpeaker``."""
        self._one, self._silence = OneSpeaker(topic, type), silence
        self._new_since, self._rivals = -math.inf, ""

    def look(self, now: float, speakers: Sequence[Speaker], met: int = 0) -> str:
        """Why what is said now must not be believed, one sentence; else empty.

        Args:
            now: real time, seconds.
            speakers: see ``OneSpeaker.look``.
            met: see there.
        """
        if found := self._one.look(speakers, met):
            self._one.forget()  # whoever is left is new
            self._new_since, self._rivals = now, found
        elif now - self._new_since >= self._silence:
            self._rivals = ""
        return self._rivals


def _named(speaker: Speaker) -> str:
    return "a node without a name yet" if speaker.node == UNKNOWN_NODE else speaker.node
