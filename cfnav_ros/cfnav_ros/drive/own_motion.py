"""A motion that the base makes by itself when asked: leaving its dock, or going back to it. Pure.

Whoever asks the base gives a future: of an empty text once it says that it is done, else of the
reason why not, as part of a sentence. Canceling the future cancels the motion.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

Begin = Callable[[], "Future[str] | None"]
"""Asks the base; None while nobody is there who would do it."""

NOT_LEFT = "The robot did not leave its dock"
NOT_BACK = "The robot did not go back to its dock"


class OwnMotion:
    """Waits until it can be asked for, then until it is over."""

    def __init__(
        self, t: float, begin: Begin, failed: str, patience: float, timeout: float
    ) -> None:
        """Prepare; the first ``update`` may ask.

        Args:
            t: node time, seconds.
            begin: asks the base.
            failed: how the sentence begins that says that it did not come about.
            patience: to find somebody who does it, seconds.
            timeout: for the motion, seconds.
        """
        self._begin, self._failed = begin, failed
        self._patience, self._timeout = patience, timeout
        self._since = t
        self._answer: Future[str] | None = None

    def update(self, t: float, waiting: str, there: bool) -> str | None:
        """Go on.

        Args:
            t: node time, seconds.
            waiting: one sentence while the base may not be moved yet, else empty.
            there: whether the base says that it is where the motion leads.

        Returns:
            None while it goes on, empty when it is made, else one sentence why not.
        """
        if self._answer is None:
            self._answer = None if waiting else self._begin()
            if self._answer is not None:
                self._since = t
            elif t - self._since > self._patience:
                return waiting or f"{self._failed}: nobody offers that."
            return None
        if self._answer.done():
            if why := self._answer.result():
                return f"{self._failed}: {why}."
            if there:
                return ""
        if t - self._since > self._timeout:
            self.cancel()
            return f"{self._failed} within {self._timeout:g} s."
        return None

    def cancel(self) -> None:
        """Have the base stop it."""
        if self._answer is not None:
            self._answer.cancel()
