"""Who speaks: every input that a drive's safety hangs on comes from one publisher. Pure.

A publisher is known by its GID, which the middleware gives to each and no message can claim; names
can be had twice.
"""

from __future__ import annotations

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
    """The one publisher of a topic: the first that is seen there alone.

    Attributes:
        topic: its name, resolved.
        type: of its messages, such as sensor_msgs/msg/LaserScan.
    """

    def __init__(self, topic: str, type: str) -> None:
        self.topic, self.type = topic, type
        self._known: bytes | None = None

    def forget(self) -> None:
        """Another one may speak from now on."""
        self._known = None

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
            if self._known is None:
                self._known = speaker.gid
            elif speaker.gid != self._known:
                return f"{_named(speaker)} publishes {self.topic} now, in place of another one."
        if met > 1:
            return (
                f"Another publisher of {self.topic} came and went: whose words came meanwhile "
                "cannot be told."
            )
        return ""


def _named(speaker: Speaker) -> str:
    return "a node without a name yet" if speaker.node == UNKNOWN_NODE else speaker.node
