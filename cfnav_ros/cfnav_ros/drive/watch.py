"""What the inputs of an episode call for: an end, a stop until it is over, or nothing. Pure.

The order is that of how much may go wrong: a base that must not be driven, then inputs that cannot
be trusted, then a LiDAR that sees nothing (which forbids driving ahead, but no turn).
"""

from __future__ import annotations

import math
from dataclasses import replace

from cfnav_ros.drive.inputs import SensorInputs, unusable
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.lidar.estimate import Verdict


def forbids(inputs: SensorInputs, least_battery: float = 0.0) -> str:
    """One sentence when the base must not be driven at all, else empty."""
    if not inputs.powered:
        return "The wheels have no power: release the emergency stop of the base."
    if inputs.docked:
        return "The robot sits on its dock: undock it first."
    if inputs.battery < least_battery:
        return (
            f"The battery holds {inputs.battery:.0%} (limit {least_battery:.0%}): let the robot "
            "charge on its dock."
        )
    return inputs.base.fault


class Watch:
    """Judges the inputs of one episode, and for how long they have been what they are."""

    def __init__(self, limits: EpisodeLimits) -> None:
        self._limits = limits
        self._type = ""
        self._usable_at = self._seeing_at = 0.0

    def start(self, t: float) -> None:
        """From node time t (seconds) on, inputs are waited for."""
        self._usable_at = self._seeing_at = t

    def drive(self, inputs: SensorInputs) -> None:
        """From now on the base is driven: it must stay what it is."""
        self._type = inputs.base.type

    def forbids(self, inputs: SensorInputs) -> str:
        """One sentence when the base must not be driven any more, else empty."""
        base = inputs.base
        fault = forbids(inputs, self._limits.least_battery) or (inputs.rival if self._type else "")
        if not fault and self._type and base.ready and base.type != self._type:
            return f"The listener on cmd_vel now wants {base.type}, before it was {self._type}."
        return fault

    def forbids_own(self, inputs: SensorInputs, leaves: bool) -> str:
        """One sentence when the base must not leave its dock, or go back to it, else empty.

        Who else speaks matters to a drive only: on the dock drivers come and go. An empty battery
        is a reason to go there.
        """
        battery = inputs.battery if leaves else math.nan
        return self.forbids(replace(inputs, docked=False, rival="", battery=battery))

    def stops(self, t: float, inputs: SensorInputs) -> str:
        """One sentence while the robot must stand because an input cannot be used, else empty."""
        limits = self._limits
        complaint = (
            inputs.rival
            or unusable(t, inputs, limits.ages, limits.lidar, limits.has_tilt)
            or inputs.picture.fault
            or inputs.picture.waiting
            or self._waits_for_base(inputs)
        )
        if not complaint:
            self._usable_at = t
        return complaint

    def _waits_for_base(self, inputs: SensorInputs) -> str:
        # A listener that joins a drive, such as a recorder, has no name for a moment: no reason
        # to stop.
        return inputs.base.waiting if inputs.base.deaf or not self._type else ""

    def blindness(self, inputs: SensorInputs) -> str:
        """One sentence while the LiDAR is needed and sees nothing, else empty."""
        estimate = inputs.estimate.estimate
        if not self._limits.lidar or estimate.verdict is not Verdict.BLIND:
            return ""
        return f"The LiDAR is blind: {estimate.reason}"

    def gives_up(self, t: float, inputs: SensorInputs, complaint: str) -> str:
        """One sentence when ``complaint`` or blindness has lasted for too long, else empty."""
        blindness = self.blindness(inputs)
        if not blindness:
            self._seeing_at = t
        if complaint and t - self._usable_at > self._limits.lost_timeout:
            return complaint
        if t - self._seeing_at > self._limits.blind_timeout:
            return complaint or blindness
        return ""
