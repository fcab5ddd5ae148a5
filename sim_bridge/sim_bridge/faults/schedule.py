"""Which faults hold now: orders that wait for a time or a motion, and what they do to messages.

Owns no clock and knows no ROS: simulated time and motion are arguments.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sim_bridge.faults.faults import EVERYTHING, FAULTS, Alter
from sim_bridge.robot.base import TrueMotion

DRIVING_SPEED = 0.1
"""m/s; faster is driving."""
TURNING_RATE = 0.3
"""rad/s; faster is turning."""
STANDING_S = 0.2
"""s of rest that count as standing."""

WHEN = ("now", "driving", "turning", "standing")


def does(motion: TrueMotion, when: str, t: float) -> bool:
    """Whether the robot does one of ``WHEN`` at simulated time t, s."""
    if when == "driving":
        return abs(motion.v) > DRIVING_SPEED
    if when == "turning":
        return abs(motion.w) > TURNING_RATE
    if when == "standing":
        return motion.still_since is not None and t - motion.still_since >= STANDING_S - 1e-9
    return True


@dataclass(frozen=True)
class FaultOrder:
    """A fault that is to begin.

    Attributes:
        fault: a name of ``FAULTS``.
        when: one of ``WHEN``, waited for from ``at`` on.
        at: s of simulated time before which it does not begin.
        duration: s after which it mends itself; 0 never, unless the table says so.

    Raises:
        ValueError: with one sentence, for a value that makes no sense.
    """

    fault: str
    when: str = "now"
    at: float = 0.0
    duration: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.fault, str) or self.fault not in FAULTS:
            raise ValueError(f"fault {self.fault!r} is unknown; known are {', '.join(FAULTS)}.")
        if not isinstance(self.when, str) or self.when not in WHEN:
            raise ValueError(f"when is {self.when!r}; expected one of {', '.join(WHEN)}.")
        for name, value in (("at", self.at), ("duration", self.duration)):
            number = isinstance(value, (int, float)) and not isinstance(value, bool)
            if not (number and 0 <= value < math.inf):
                raise ValueError(f"{name} of {self.fault} is {value!r}; expected s, 0 or more.")


def read_schedule(path: str) -> list[FaultOrder]:
    """The orders of a YAML file: a list of {fault, at or when, duration}.

    Raises:
        ValueError: with one sentence, when the file cannot be read or makes no sense.
    """
    try:
        rows = yaml.safe_load(Path(path).read_text())
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"faults: {path} cannot be read ({error}).") from error
    except yaml.YAMLError as error:
        where = " ".join(str(error).split())
        raise ValueError(f"faults: {path} is no YAML file ({where}).") from error
    known = [f.name for f in fields(FaultOrder)]
    if not isinstance(rows, list):
        raise ValueError(f"faults: {path} holds no list; expected rows like {{fault: e_stop}}.")
    for row in rows:
        if not isinstance(row, dict) or "fault" not in row or set(row) - set(known):
            raise ValueError(f"faults: {path} has the row {row}; expected {', '.join(known)}.")
    try:
        return [FaultOrder(**row) for row in rows]
    except ValueError as error:
        raise ValueError(f"faults: {path}: {error}") from error


@dataclass(frozen=True)
class _Active:
    ends: float
    alter: Alter | None


class FaultSchedule:
    """The faults that wait and those that hold.

    Args:
        orders: what is planned from the start.
        seed: of what faults draw.
    """

    def __init__(self, orders: Iterable[FaultOrder] = (), seed: int = 0) -> None:
        self._waiting = list(orders)
        self._active: dict[str, _Active] = {}
        self._mended: list[str] = []
        self._rng = np.random.default_rng()
        self.reseed(seed)

    def reseed(self, seed: int) -> None:
        """Draw anew from a seed, faults that hold included."""
        self._rng.bit_generator.state = np.random.default_rng([seed, 1]).bit_generator.state

    @property
    def active(self) -> frozenset[str]:
        """Names of the faults that hold."""
        return frozenset(self._active)

    def order(self, order: FaultOrder) -> None:
        """Begin a fault anew, in place of the same one that waits or holds."""
        self.mend(order.fault)
        self._waiting.append(order)

    def mend(self, fault: str) -> None:
        """End a fault; an empty name ends all, those that wait included.

        Raises:
            ValueError: with one sentence, for an unknown name.
        """
        if fault and fault not in FAULTS:
            raise ValueError(f"fault {fault!r} is unknown; known are {', '.join(FAULTS)}.")
        self._waiting = [o for o in self._waiting if fault and o.fault != fault]
        for name in [fault] if fault else list(self._active):
            if self._active.pop(name, None):
                self._mended.append(name)

    def update(self, t: float, motion: TrueMotion) -> list[tuple[str, bool]]:
        """Let faults end and begin.

        Args:
            t: simulated time, s.
            motion: of the robot.

        Returns:
            Names, and whether each holds from now on, in the order of events. One that begins
            anew while it holds ends first.
        """
        changes = [(name, False) for name in self._mended]
        self._mended = []
        for name in [name for name, fault in self._active.items() if t >= fault.ends - 1e-9]:
            del self._active[name]
            changes.append((name, False))
        for order in [o for o in self._waiting if t >= o.at - 1e-9 and does(motion, o.when, t)]:
            self._waiting.remove(order)
            if self._active.pop(order.fault, None):
                changes.append((order.fault, False))
            self._begin(order, t)
            changes.append((order.fault, True))
        return changes

    def pass_on(self, topic: str, message: Any, t: float) -> tuple[Any, float]:
        """What becomes of a message.

        Args:
            topic: its topic.
            message: it may be changed in place.
            t: when it was made, simulated s.

        Returns:
            The message to send, None for none, and by how many s it comes later.
        """
        delay = 0.0
        for name, active in self._active.items():
            row = FAULTS[name]
            if topic not in row.topics and EVERYTHING not in row.topics:
                continue
            delay += row.delay
            if active.alter is not None:
                message = active.alter(message, t)
            if message is None:
                break
        return message, delay

    def _begin(self, order: FaultOrder, t: float) -> None:
        row = FAULTS[order.fault]
        lasts = min(order.duration or math.inf, row.lasts)
        alter = row.begin(self._rng) if row.begin else None
        self._active[order.fault] = _Active(t + lasts, alter)
        # In the order of the table, whichever began first: see ``faults.FAULTS``.
        self._active = {name: self._active[name] for name in FAULTS if name in self._active}
