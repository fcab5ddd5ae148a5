"""When simulated time stands and waits for the policy. Pure: stamps are whatever equals itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

MOMENT_PERIOD = 0.05
"""s of simulated time between moments."""

PATIENCE_S = 0.5
"""s of simulated time after a start within which every sensor has spoken, if it ever does."""


class LockStepServer:
    """Who waits for whom.

    Time runs freely until the first answer ever: somebody must be there who hears the sensors
    before waiting makes sense. From then on it stands at every moment until that is answered.
    """

    def __init__(self) -> None:
        self.engaged = False
        self._asked: object = None
        self._on_answer: Callable[[], Any] | None = None

    @property
    def stands(self) -> bool:
        """Whether time stands."""
        return self.engaged and self._asked is not None

    def begin(self, on_answer: Callable[[], Any]) -> None:
        """Forget the moment that waits, as the robot is elsewhere now.

        Args:
            on_answer: called when the first moment from now on is answered.
        """
        self._asked = None
        self._on_answer = on_answer

    def ask(self, stamp: object, listeners: int) -> None:
        """A moment with this stamp was announced to so many listeners."""
        self._asked = stamp
        if not listeners:
            self._tell()

    def answer(self, stamp: object, idle: bool) -> None:
        """Take an answer; one to another moment than the newest only shows that somebody hears."""
        self.engaged = True
        if stamp != self._asked:
            return
        self._tell()
        if not idle:
            self._asked = None

    def _tell(self) -> None:
        on_answer, self._on_answer = self._on_answer, None
        if on_answer is not None:
            on_answer()
