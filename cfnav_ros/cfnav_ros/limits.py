"""The limits of an episode on the robot, as parameters of ``policy_node``. Pure."""

from __future__ import annotations

from dataclasses import dataclass, field

from cfnav_ros.inputs import AgeLimits
from cfnav_ros.motion import MotionLimits


@dataclass(frozen=True)
class EpisodeLimits:
    """When an episode observes, waits, gives up. Times are seconds of node time."""

    max_steps: int = field(default=100, metadata={"help": "decisions, Done included"})
    settle: float = field(default=0.15, metadata={"help": "from standing to a usable picture, s"})
    preflight_timeout: float = field(default=10.0, metadata={"help": "to find robot and inputs, s"})
    lost_timeout: float = field(default=2.0, metadata={"help": "stand on lost inputs, then end, s"})
    observe_timeout: float = field(default=5.0, metadata={"help": "to come to rest and look, s"})
    think_timeout: float = field(default=10.0, metadata={"help": "for one decision, s"})
    tilt_timeout: float = field(default=5.0, metadata={"help": "for one camera tilt, s"})
    tilt_tolerance_deg: float = field(default=1.0, metadata={"help": "of the camera tilt, deg"})
    stop_time: float = field(default=0.5, metadata={"help": "zero velocity at the end, s"})
    blind_timeout: float = field(default=5.0, metadata={"help": "blind LiDAR ends it, s"})
    max_failed_motions: int = field(
        default=8, metadata={"help": "in a row, whatever the reason: there is no way on"}
    )
    max_stalls: int = field(
        default=3, metadata={"help": "motions in a row without progress: the base is stuck"}
    )
    max_pushes: int = field(
        default=8, metadata={"help": "times that the base may move by itself in an episode"}
    )
    lidar: bool = field(
        default=True,
        metadata={"help": "collision probability from the LiDAR; off: the bundle's own, no veto"},
    )
    veto: bool = field(default=True, metadata={"help": "the LiDAR may forbid a MoveAhead"})
    veto_probability: float = field(default=0.5, metadata={"help": "from which it does"})
    guard_slack: float = field(
        default=0.05, metadata={"help": "clearance lost while driving that stops a MoveAhead, m"}
    )
    has_tilt: bool = field(default=True, metadata={"help": "the camera tilts on command"})
    motion: MotionLimits = field(default_factory=MotionLimits)
    ages: AgeLimits = field(default_factory=AgeLimits)

    def __post_init__(self) -> None:
        if self.max_steps < 1:
            raise ValueError(f"max_steps is {self.max_steps}, expected at least 1.")
        if not 0 < self.veto_probability <= 1:
            raise ValueError(
                f"veto_probability is {self.veto_probability}, expected a number in (0, 1]."
            )
