"""What an iRobot Create 3 makes of velocity commands, and how it counts its own motion.

Knows neither the simulator nor ROS and owns no clock: time is an argument.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class BaseLimits:
    """Limits of the base with ``safety_override: none``.

    Source: create3_docs ``safety.md``; create3_sim ``control.yaml`` and
    ``motion_control_node.cpp``.
    """

    speed: float = 0.306
    """Fastest a wheel turns, m/s along the floor."""
    yaw_rate: float = 1.9
    """rad/s."""
    wheel_acceleration: float = 0.9
    """m/s^2; in place this is 0.9 / (0.233 / 2) = 7.725 rad/s^2 of yaw."""
    wheel_separation: float = 0.233
    """m."""
    command_timeout: float = 0.5
    """s after the last command received; then the base brakes to a stop."""


@dataclass(frozen=True)
class TrueMotion:
    """How the robot truly moves.

    Attributes:
        v: m/s forward.
        w: rad/s counter-clockwise.
        still_since: s of simulated time since when it has stood still; None while it moves.
    """

    v: float
    w: float
    still_since: float | None


class Base:
    """Turns received commands into the velocity the wheels have at each moment.

    A command beyond the limits is scaled as a whole, so the robot keeps the curvature that was
    asked for. While the wheels speed up or brake, the one with the longer way to go changes at
    ``wheel_acceleration`` and the other in proportion, so the curvature holds there too.
    """

    def __init__(self, limits: BaseLimits = BaseLimits()) -> None:
        self.limits = limits
        self.stop()

    def stop(self) -> None:
        """Forget every command and stand still at once, as a robot that was just put down."""
        self.block()
        self.forget()

    def block(self) -> None:
        """Stand still at once: the wheels cannot turn."""
        self._left = self._right = 0.0

    def forget(self) -> None:
        """Drop the command that was received last."""
        self._target = (0.0, 0.0)
        self._received = -math.inf

    def stop_backing(self) -> None:
        """Drop the command when it drives backward."""
        if sum(self._target) < 0:
            self.forget()

    def command(self, t: float, v: float, w: float) -> None:
        """Receive a velocity command.

        Args:
            t: time of reception, s.
            v: forward speed asked for, m/s.
            w: yaw rate asked for, rad/s, counter-clockwise positive.

        A command that is not finite is a command to stand still.
        """
        if not (math.isfinite(v) and math.isfinite(w)):
            v = w = 0.0
        self._target = self._wheels(v, w)
        self._received = t

    def update(
        self, t: float, dt: float, own: tuple[float, float] | None = None
    ) -> tuple[float, float]:
        """Advance the wheels.

        Args:
            t: time at the beginning of the step, s.
            dt: length of the step, s.
            own: m/s and rad/s of what the base does by itself, in place of any command.

        Returns:
            Forward speed in m/s and yaw rate in rad/s at the end of the step.
        """
        # Times are sums of steps: without the tolerance the stop would come a step late.
        expired = t - self._received >= self.limits.command_timeout - 1e-9
        target = (0.0, 0.0) if expired else self._target
        left, right = target if own is None else self._wheels(*own)
        change = max(abs(left - self._left), abs(right - self._right))
        allowed = self.limits.wheel_acceleration * dt
        share = 1.0 if change <= allowed else allowed / change
        self._left += share * (left - self._left)
        self._right += share * (right - self._right)
        yaw_rate = (self._right - self._left) / self.limits.wheel_separation
        return (self._left + self._right) / 2, yaw_rate

    def _wheels(self, v: float, w: float) -> tuple[float, float]:
        """Speeds of the left and the right wheel, m/s, within the limits."""
        half = self.limits.wheel_separation / 2
        left, right = v - w * half, v + w * half
        excess = max(
            abs(left) / self.limits.speed,
            abs(right) / self.limits.speed,
            abs(w) / self.limits.yaw_rate,
            1.0,
        )
        return left / excess, right / excess


class SimulatedOdometry:
    """The base's own account of where it is: frame ``odom``, zero where it was switched on.

    It adds up the motion made in the frame of the robot, so a robot that is lifted and put down
    elsewhere goes on counting from where it was, as the real one does. The motion is what the
    sensors tell of the true one, see ``noise.Noise.count``.
    """

    def __init__(self) -> None:
        self.x = 0.0
        self.y = 0.0
        self.yaw = 0.0

    def move(self, forward: float, left: float, turn: float) -> None:
        """Add one small motion.

        Args:
            forward: m along the heading before the motion.
            left: m to the left of it; a robot that slides along a wall moves sideways.
            turn: rad, counter-clockwise positive.
        """
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        self.x += c * forward - s * left
        self.y += s * forward + c * left
        self.yaw = math.remainder(self.yaw + turn, math.tau)
