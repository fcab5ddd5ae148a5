"""The detectors of contacts that know no episodes, together. Pure."""

from __future__ import annotations

from cfnav_ros.bags.contacts import BumpContacts, ClearanceContacts, Contact, Whereabouts
from cfnav_ros.bags.events import Bumps, Event, Judged, Pose, Velocity
from cfnav_ros.bags.stalls import StallContacts


class Detectors:
    """All but that of the truth, whose counter begins anew with each episode."""

    def __init__(self) -> None:
        self._where = Whereabouts()
        self._bumps, self._stalls = BumpContacts(), StallContacts()
        self._clearance = ClearanceContacts()

    def see(self, t: int, event: Event, begin_ns: int) -> list[Contact]:
        """Take an event of a time; returns the contacts that it shows.

        Args:
            t: nanoseconds.
            event: any.
            begin_ns: log time at which the bag begins, nanoseconds.
        """
        contact: Contact | None = None
        if isinstance(event, Pose):
            self._where.see(t, event)
            contact = self._stalls.moved(t, event, self._where)
        elif isinstance(event, Velocity):
            self._stalls.told(t, event)
        elif isinstance(event, Bumps):
            contact = self._bumps.see(t, event, self._where, begin_ns)
        elif isinstance(event, Judged):
            contact = self._clearance.see(t, event, self._where)
        return [contact] if contact else []
