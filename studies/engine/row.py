"""``Row``: what one row of any study trains and tests, and which rows it is compared with."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from cfnav_core.agent.config import MethodName, ModelName
from cfnav_core.task.p_hat import PHat, needs_lidar

Split = Literal["data1", "data2"]
Schedule = Literal["usual", "longer", "later", "tenfold"]
"""When a run's stages begin and end: as its preset says; with as many episodes as methods in which
collisions cost in stage one, the more of them in stage two; with a longer stage one; or with ten
times as many episodes in stage two, unless it is long already."""

Variant = Literal["", "listening", "dropout"]
"""How a run differs from its method: in nothing; p_hat is added to the action logits too, see
``RunConfig``; or picture features have dropout, as in the published networks."""


@dataclass(frozen=True)
class Claimed:
    """What the paper says of a row, percent.

    Attributes:
        cf_sr: mean CF-SR and, where it says one, its standard deviation.
        cf_spl: mean CF-SPL and its standard deviation.
    """

    cf_sr: tuple[float, float | None]
    cf_spl: tuple[float | None, float | None] = (None, None)


@dataclass(frozen=True)
class Row:
    """One row of a table.

    Attributes:
        table: that it stands in.
        name: "ours (MODEL)" for the paper's method.
        model: row of ``MODELS``. method: row of ``METHODS``. split: row of ``SPLITS``.
        paper: what the paper says, None for rows of our own.
        p_hat: what the policy is given at test; "own" is its own prediction.
        veto: the LiDAR may forbid a MoveAhead at test.
        against: method of the row that the gain is over, in the same model and split.
        schedule, variant: of training; what the gain is over has the same schedule.
        sample: actions are drawn at test; the most probable ones when not.
        usual: p_hat of the rows that it is compared with.
        visual_shift: strength of another light and lens, in live trials.
    """

    table: str
    name: str
    model: ModelName
    method: MethodName
    split: Split
    paper: Claimed | None = None
    p_hat: PHat = "own"
    veto: bool = False
    against: MethodName | None = None
    schedule: Schedule = "usual"
    sample: bool = False
    variant: Variant = ""
    usual: PHat = "own"
    visual_shift: float = 0.0

    @property
    def reads_lidar(self) -> bool:
        """Whether its test needs what the LiDAR node says in the test rooms."""
        return self.veto or needs_lidar(self.p_hat)

    @property
    def itself(self) -> Row | None:
        """The same policies with their own p_hat and without a veto.

        None for such rows, and for plain, which has no p_hat.
        """
        if self.method == "plain" or (self.p_hat == "own" and not self.veto):
            return None
        return replace(self, p_hat="own", veto=False)

    @property
    def reference(self) -> Row | None:
        """What the gain is over."""
        if self.against is None:
            return None
        return replace(
            self, method=self.against, p_hat=self.usual, veto=False, against=None, variant=""
        )

    @property
    def vetoed(self) -> Row | None:
        """Plain under the same veto; None for plain, and without a veto."""
        reference = self.reference
        if reference is None or not self.veto or self.method == reference.method:
            return None
        return replace(reference, veto=True)

    @property
    def rival(self) -> Row | None:
        """The paper's method with the usual p_hat, trained as long and acting alike.

        None for it, for plain, whose difference is the gain, and for other methods where p_hat is
        another.
        """
        if self.method == "ours" or self.against is None or self.p_hat != self.usual:
            return None
        return replace(self, method="ours", veto=False)

    @property
    def compared(self) -> list[Row]:
        """All of these."""
        return [of for of in (self.reference, self.itself, self.vetoed, self.rival) if of]
