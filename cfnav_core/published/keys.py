"""State keys ``x|z|rotation|horizon`` of published data, and where each action leads.

x and z are counted in whole quarter metres and angles in whole degrees, so no key is ever missed
for the last digit of a float; -0.00 and 0.00 are one key. Rotation is clockwise from +z (x right,
z forward); scenes here have y = z and headings counter-clockwise from +x.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cfnav_core.scenes.scene import OfflineScene, SceneError
from cfnav_core.task.actions import STEP_M, Action

TURN_DEG, LOOK_DEG = 45, 30

_AHEAD = {
    0: (0, 1), 45: (1, 1), 90: (1, 0), 135: (1, -1),
    180: (0, -1), 225: (-1, -1), 270: (-1, 0), 315: (-1, 1),
}  # fmt: skip
"""Quarter metres (x, z) of MoveAhead; on diagonals both, as the published environment moves."""


class Key(NamedTuple):
    """One state: ``x`` and ``z`` in quarter metres, ``rotation`` and ``horizon`` in degrees."""

    x: int
    z: int
    rotation: int
    horizon: int

    @classmethod
    def parse(cls, text: str) -> Key:
        """Read a key in any spelling of its numbers.

        Raises:
            SceneError: it is no state of the published grid.
        """
        wrong = (
            f"found state {text!r}, expected x|z|rotation|horizon with multiples of 0.25 m, "
            "of 45 degrees, and a horizon of 0 or 30"
        )
        try:
            numbers = tuple(float(part) for part in text.split("|"))
            x, z, rotation, horizon = numbers
            key = cls(round(x / STEP_M), round(z / STEP_M), round(rotation), round(horizon))
        except (ValueError, OverflowError) as error:
            raise SceneError(wrong) from error
        exact = numbers == (key.x * STEP_M, key.z * STEP_M, key.rotation, key.horizon)
        if not exact or key.rotation not in _AHEAD or key.horizon not in (0, LOOK_DEG):
            raise SceneError(wrong)
        return key

    @classmethod
    def of(cls, scene: OfflineScene, state: int) -> Key:
        """The key of a scene's state."""
        x, y = (round(float(v) / STEP_M) for v in scene.positions[scene.position[state]])
        rotation = (90 - int(scene.heading[state]) * TURN_DEG) % 360
        return cls(x, y, rotation, int(scene.horizon[state]) * LOOK_DEG)

    def __str__(self) -> str:
        return f"{self.x * STEP_M:.2f}|{self.z * STEP_M:.2f}|{self.rotation}|{self.horizon}"

    @property
    def heading(self) -> int:
        """0..7, counter-clockwise from +x."""
        return (90 - self.rotation) // TURN_DEG % 8

    def after(self, action: Action) -> Key | None:
        """The key an action leads to when nothing is in the way; None when it cannot be done."""
        match action:
            case Action.MoveAhead:
                dx, dz = _AHEAD[self.rotation]
                return self._replace(x=self.x + dx, z=self.z + dz)
            case Action.RotateLeft:
                return self._replace(rotation=(self.rotation - TURN_DEG) % 360)
            case Action.RotateRight:
                return self._replace(rotation=(self.rotation + TURN_DEG) % 360)
            case Action.LookUp:
                return self._replace(horizon=0) if self.horizon else None
            case Action.LookDown:
                return None if self.horizon else self._replace(horizon=LOOK_DEG)
        return None


def state_of(scene: OfflineScene, text: str) -> int:
    """Index of the state with a published key.

    Raises:
        SceneError: the scene has no such state.
    """
    key = Key.parse(text)
    at = np.nonzero((scene.positions == np.array((key.x, key.z)) * STEP_M).all(1))[0]
    same = (scene.heading == key.heading) & (scene.horizon == key.horizon // LOOK_DEG)
    found = np.nonzero(same & np.isin(scene.position, at))[0]
    if len(found) != 1:
        raise SceneError(f"found no state {text} in {scene.name}; take scene and starts of one set")
    return int(found[0])
