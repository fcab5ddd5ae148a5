"""The detectors of contacts that know no episodes, together. Pure."""

from __future__ import annotations

from cfnav_ros.bags.files.events import Bumps, Event, Judged, Pose, Velocity
from cfnav_ros.bags.judge.block_stalls import BlockStalls, Sight, sight
from cfnav_ros.bags.judge.clocks import Pace
from cfnav_ros.bags.judge.contacts import (
    STALL,
    BumpContacts,
    ClearanceContacts,
    Contact,
    Whereabouts,
)
from cfnav_ros.bags.judge.odometry import BLOCKS_S, OdometryQuality
from cfnav_ros.bags.judge.stalls import NO_START, StallContacts


class Detectors:
    """All but that of the truth, whose counter begins anew with each episode.

    Stalls are looked for over blocks of odometry of every length at once, as its noise is known
    only later: contacts say of which length they are.

    Attributes:
        quality: of the odometry so far.
    """

    def __init__(self) -> None:
        self.quality = OdometryQuality()
        self._pace = Pace()
        self._where = Whereabouts()
        self._bumps = BumpContacts()
        self._stalls: dict[float, StallContacts | BlockStalls] = {0.0: StallContacts()}
        self._stalls |= {block_s: BlockStalls(block_s) for block_s in BLOCKS_S}
        self._clearance = ClearanceContacts()

    @property
    def block_s(self) -> float:
        """Length of the blocks whose stalls count, seconds, by the noise so far."""
        block_s = self.quality.block_s
        return BLOCKS_S[-1] if block_s is None else block_s

    def counts(self, contact: Contact) -> bool:
        """Whether a contact is one, and not of blocks that are too short or longer than needed."""
        return contact.source not in (STALL, NO_START) or contact.block_s == self.block_s

    @property
    def sight(self) -> Sight:
        """Which stalls can be seen by the odometry and the commands so far."""
        if (pace := self._pace.other) is not None:
            return Sight(
                f"the odometry's clock ran {pace:.2f} times as fast as that of the log, by which "
                "commands are told: record with use_sim_time",
                blind=True,
            )
        return sight(self.quality, self._stalls[self.block_s].slow_commands_s)

    def see(self, t: int, event: Event, begin_ns: int) -> list[Contact]:
        """Take an event of a time; returns the contacts that it shows.

        Args:
            t: nanoseconds.
            event: any.
            begin_ns: log time at which the bag begins, nanoseconds.
        """
        found: list[Contact | None] = []
        if isinstance(event, Pose):
            self._pace.take(event)
            self.quality.take(t, event)
            self._where.see(t, event)
            found = [stalls.moved(t, event, self._where) for stalls in self._stalls.values()]
        elif isinstance(event, Velocity):
            for stalls in self._stalls.values():
                stalls.told(t, event)
        elif isinstance(event, Bumps):
            found = [self._bumps.see(t, event, self._where, begin_ns)]
        elif isinstance(event, Judged):
            found = [self._clearance.see(t, event, self._where)]
        return [contact for contact in found if contact]
