"""The limits of an episode on the robot, as parameters of ``policy_node``. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import TypeVar

from cfnav_core.robot.settings import setting
from cfnav_core.task.limits import STEP_LIMIT, VETO_PROBABILITY
from cfnav_core.task.p_hat import DRIVEN, PHat, check_kind
from cfnav_ros.drive.inputs import AgeLimits
from cfnav_ros.drive.motion import MotionLimits
from cfnav_ros.lidar.estimate import Estimate, Verdict

T = TypeVar("T")


@dataclass(frozen=True)
class EpisodeLimits:
    """When an episode observes, waits, gives up. Times are seconds of node time.

    What may be changed while the node runs holds at once (``with_live``).

    ``guard_slack``: a scan takes a turn of up to 0.13 s from its stamp on, an A1M8 mounted sideways
    as on a TurtleBot 4 looks ahead within the first 0.1 s of it, and 0.1 s at 0.2 m/s are the 0.02
    m by which the way left at the stamp exceeds that at the look.
    """

    max_steps: int = setting(STEP_LIMIT, "decisions, Done included", 1, 100000)
    settle: float = setting(0.15, "from standing to a usable picture, s", 0.0, 5.0)
    preflight_timeout: float = setting(10.0, "to find robot and inputs, s", 0.5, 600.0)
    lost_timeout: float = setting(2.0, "stand on lost inputs, then end, s", 0.1, 60.0)
    observe_timeout: float = setting(5.0, "to come to rest and look, s", 0.5, 60.0)
    think_timeout: float = setting(10.0, "for one decision, s", 0.1, 600.0)
    tilt_timeout: float = setting(5.0, "for one camera tilt, s", 0.5, 60.0)
    tilt_tolerance_deg: float = setting(1.0, "of the camera tilt, deg", 0.1, 10.0)
    dock_timeout: float = setting(
        60.0, "for the base to leave its dock, or to go back to it, s", 1.0, 600.0
    )
    stop_time: float = setting(0.5, "zero velocity at the end, s", 0.1, 10.0)
    blind_timeout: float = setting(5.0, "blind LiDAR ends it, s", 0.5, 60.0)
    max_failed_motions: int = setting(
        8, "in a row, whatever the reason: there is no way on", 1, 1000
    )
    max_stalls: int = setting(3, "motions in a row without progress: the base is stuck", 1, 1000)
    command_lag: float = setting(
        0.3,
        "by which the base may do late what it is told, s; 0: any time. 0.1 s more ends the drive "
        "at once, less in max_lags motions in a row",
        0.0,
        10.0,
    )
    max_lags: int = setting(2, "motions in a row that began or ended later than that", 1, 100)
    max_pushes: int = setting(8, "times that the base may move by itself in an episode", 1, 1000)
    p_hat: str = setting(
        "lidar",
        "collision probability: lidar, own (the bundle's; without LiDAR, so veto must be false) or "
        "both (the larger); to study what it does: zero, or earlier (the LiDAR's of any decision "
        "so far)",
    )
    veto: bool = setting(True, "the LiDAR may forbid a MoveAhead")
    veto_probability: float = setting(VETO_PROBABILITY, "from which it does", 0.001, 1.0)
    guard_slack: float = setting(
        0.02, "by which a way may look too short without stopping a MoveAhead, m", 0.0, 0.05
    )
    least_battery: float = setting(
        0.15, "charge below which it drives no more: a TurtleBot 4 goes off at 0.12", 0.0, 1.0
    )
    has_tilt: bool = setting(True, "the camera tilts on command")
    motion: MotionLimits = field(default_factory=MotionLimits)
    ages: AgeLimits = field(default_factory=AgeLimits)

    def __post_init__(self) -> None:
        if self.max_steps < 1:
            raise ValueError(f"max_steps is {self.max_steps}, expected at least 1.")
        check_kind(self.p_hat, DRIVEN)
        if self.veto and not self.lidar:
            raise ValueError(
                "p_hat is 'own', which does without the LiDAR, and veto is true, which needs it: "
                "set veto to false, or p_hat to lidar or both."
            )
        if not 0 < self.veto_probability <= 1:
            raise ValueError(
                f"veto_probability is {self.veto_probability}, expected a number in (0, 1]."
            )

    @property
    def p_hat_kind(self) -> PHat:
        """The kind of p_hat that the parameter names.

        Raises:
            ValueError: it names none that a robot has.
        """
        return check_kind(self.p_hat, DRIVEN)

    @property
    def lidar(self) -> bool:
        """Whether an episode needs the LiDAR.

        Only its own predictor does without: zero stands in for the LiDAR's in a drive that waits
        for scans as any other, so that the two can be compared.
        """
        return self.p_hat != "own"

    def forbids(self, looks: Iterable[Estimate], met_before: bool) -> bool:
        """Whether the veto forbids a MoveAhead: by one look at the way, or as it met something."""
        return self.veto and (met_before or any(map(self._closed, looks)))

    def _closed(self, estimate: Estimate) -> bool:
        return estimate.verdict is Verdict.BLIND or estimate.probability >= self.veto_probability


def given_p_hat(estimate: Estimate, met_before: bool) -> float:
    """The LiDAR's probability as a policy is given it: 1 where a MoveAhead met something before."""
    return 1.0 if met_before else estimate.probability


def with_live(running: T, changed: T) -> T:
    """The dataclass ``running`` with those fields of ``changed`` that may change meanwhile."""
    taken = {}
    for spec in fields(running):  # type: ignore[arg-type]
        now, new = getattr(running, spec.name), getattr(changed, spec.name)
        if is_dataclass(now):
            taken[spec.name] = with_live(now, new)
        elif spec.metadata.get("live"):
            taken[spec.name] = new
    return replace(running, **taken)  # type: ignore[type-var]
