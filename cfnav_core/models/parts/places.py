"""Where things were last seen, kept as the robot moves: what a tracker knows, one for each object.

A detector misses most things most of the time, and no sensor is asked while a thing is out of
view. What was seen stays where it was, so its direction and distance follow from the robot's own
motions. Nothing here is learnt.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from cfnav_core.models.parts.reading import VIEW_RAD
from cfnav_core.task.actions import STEP_M, TURN_RAD, Action
from cfnav_core.task.visibility import VISIBLE_DISTANCE_M

SAME_COSINE = math.cos(math.radians(20.0))
SAME_M, SAME_SHARE = 0.4, 0.3
"""A sighting confirms the place of the one before within 20 degrees and 0.4 m or 30 %; ours. Boxes
jitter by a tenth of their size, and a diagonal of the grid is 0.1 m longer than a step."""

NEAREST_M = 0.05
"""What the robot has reached is taken to be so far away, so that it keeps a direction."""

RECENT = 8.0
"""Decisions after which what is known counts for 1/e, and for less than any new sighting; ours."""

MANY = 5.0
"""Sightings of one place, after which more say nothing new; ours."""


class Places(NamedTuple):
    """What is known of each object, float32 [B, C] each; all 0 for what was never seen.

    Attributes:
        there: 0 or 1, it was seen.
        ahead, right: of its direction on the level, one unit long.
        rise: tangent of its elevation.
        width, height: of its box, rad.
        distance: along the floor, metres; 0 where nobody knows.
        age: decisions since it was seen.
        times: how often in a row it was seen where it was expected, from different places.
    """

    there: Tensor
    ahead: Tensor
    right: Tensor
    rise: Tensor
    width: Tensor
    height: Tensor
    distance: Tensor
    age: Tensor
    times: Tensor

    @classmethod
    def read(cls, state: Tensor) -> Places:
        """From float32 [B, C, 9]."""
        return cls(*state.unbind(2))

    def write(self) -> Tensor:
        """As float32 [B, C, 9]."""
        return torch.stack(list(self), 2)

    @classmethod
    def of_sightings(
        cls, confidence: Tensor, azimuth: Tensor, elevation: Tensor, width: Tensor, height: Tensor,
        distance: Tensor,
    ) -> Places:  # fmt: skip
        """Of what is seen now: the fields of ``SIGHTINGS``, float32 [B, C] each."""
        there = (confidence > 0).to(azimuth.dtype)
        return cls(
            there, azimuth.cos() * there, azimuth.sin() * there, elevation.tan() * there,
            width, height, distance, torch.zeros_like(there), there,
        )  # fmt: skip

    def after(self, action: Tensor) -> Places:
        """Seen from where an action leads, float32 [B, 6], one-hot or zeros.

        A MoveAhead is taken to have gone its way; a robot that was stopped sees it soon enough.
        """
        left = action[:, Action.RotateLeft, None]
        turned = left + action[:, Action.RotateRight, None]
        side = left - action[:, Action.RotateRight, None]
        cos, sin = 1 - turned + turned * math.cos(TURN_RAD), side * math.sin(TURN_RAD)
        ahead, right = cos * self.ahead - sin * self.right, sin * self.ahead + cos * self.right
        known = (self.distance > 0).to(ahead.dtype)
        way = STEP_M * action[:, Action.MoveAhead, None] * known
        x, y = self.distance * ahead - way, self.distance * right
        distance = torch.where(known > 0, (x * x + y * y).sqrt().clamp(min=NEAREST_M), 0.0)
        drove = way > 0
        closer = torch.where(drove, self.distance / distance.clamp(min=NEAREST_M), 1.0)
        return Places(
            self.there, torch.where(drove, x / distance.clamp(min=NEAREST_M), ahead),
            torch.where(drove, y / distance.clamp(min=NEAREST_M), right), self.rise * closer,
            (self.width * closer).clamp(max=VIEW_RAD), (self.height * closer).clamp(max=VIEW_RAD),
            torch.where(drove, distance, self.distance), self.age + self.there, self.times,
        )  # fmt: skip

    def with_new(self, seen: Places, action: Tensor) -> Places:
        """These, with what is seen now in place of what was known of it.

        A place that was seen twice is not given up at once for a sighting elsewhere, which may be
        a false alarm or another of its kind.

        Args:
            seen: from the same place.
            action: that led here; what is looked at twice from one place is no second sighting.
        """
        cosine = self.ahead * seen.ahead + self.right * seen.right
        off, either = (self.distance - seen.distance).abs(), self.distance * seen.distance == 0
        near = either | (off <= (SAME_SHARE * seen.distance).clamp(min=SAME_M))
        same = ((cosine > SAME_COSINE) & near & (self.there > 0)).to(cosine.dtype)
        moved = action[:, [Action.MoveAhead, Action.RotateLeft, Action.RotateRight]].sum(1)
        times = torch.where(same > 0, self.times + moved[:, None], 1.0)
        seen = seen._replace(times=times * seen.there)
        kept = (same == 0) & (self.times > 1) & (self.age < RECENT)
        now = (seen.there > 0) & ~kept
        return Places(*(torch.where(now, a, b) for a, b in zip(seen, self, strict=True)))

    def context(self) -> Tensor:
        """As a model reads it, mostly in -1..1: float32 [B, C, 10]."""
        known = (self.distance > 0).to(self.there.dtype)
        return torch.stack([
            self.there, self.ahead, self.right, self.rise.clamp(-2, 2),
            (self.width / VIEW_RAD).sqrt(), (self.height / VIEW_RAD).sqrt(),
            torch.exp(-self.distance / VISIBLE_DISTANCE_M) * known, known,
            torch.exp(-self.age / RECENT) * self.there, self.times.clamp(max=MANY) / MANY,
        ], 2)  # fmt: skip


WIDTH = len(Places._fields)
FOUND = (1.0, 1.0, 0.0, 0.0, 0.5, 0.5, 0.5, 1.0, 1.0, 1.0)
"""``context`` of an object that is certainly there, near and straight ahead."""
