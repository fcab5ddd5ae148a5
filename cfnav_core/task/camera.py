"""``CameraSetUp``: where a robot's camera sits, what it shows and where it can look.

The one type that tells rooms, scenes, perception, bundles and robots which camera is meant. What
was learnt from one camera is not asked of another unnoticed.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

FOV_TOLERANCE_DEG = 4.0
"""Fields of view this near are one camera's: calibrations of one lens differ by a degree or two."""

TURTLEBOT4_TOP_M = 0.351
"""Height of the standard TurtleBot 4 (turtlebot4_description)."""

SQUARE_TOLERANCE = 0.02
"""Relative difference of the focal lengths across and down up to which pixels are squares."""

ASPECT_TOLERANCE = 0.02
"""Relative difference of width over height up to which pictures have one shape."""


@dataclass(frozen=True)
class CameraSetUp:
    """A pinhole camera on a robot.

    Attributes:
        x: m before the robot's centre.
        z: m above the floor.
        fov_deg: horizontal and vertical field of view, degrees.
        size: width and height of its pictures, pixels.
        horizons: tilts that it looks from, rad, up positive, from the level one down; one alone
            when it does not tilt.

    Raises:
        ValueError: one makes no sense; the message says which, and what was expected.
    """

    x: float
    z: float
    fov_deg: tuple[float, float]
    size: tuple[int, int]
    horizons: tuple[float, ...]

    def __post_init__(self) -> None:
        if not all(math.isfinite(v) for v in (self.x, self.z)) or self.z <= 0:
            raise ValueError(f"found a camera at x {self.x}, z {self.z}, expected metres, z over 0")
        if len(self.fov_deg) != 2 or not all(1 <= v < 179 for v in self.fov_deg):
            raise ValueError(
                f"found a field of view of {list(self.fov_deg)}, expected two of 1 to 179 degrees"
            )
        if len(self.size) != 2 or not all(isinstance(v, int) and v > 0 for v in self.size):
            raise ValueError(
                f"found a picture size of {list(self.size)}, expected width and height in pixels"
            )
        x, y = (share * pixels for share, pixels in zip(self.focal_share, self.size, strict=True))
        if abs(x / y - 1) > SQUARE_TOLERANCE:
            (wide, high), (width, height) = self.fov_deg, self.size
            square = math.degrees(2 * math.atan(math.tan(math.radians(high) / 2) * width / height))
            raise ValueError(
                f"found a field of view of {wide:g} x {high:g} degrees in pictures of {width} x "
                f"{height} pixels, whose pixels are squares when {high:g} degrees down come with "
                f"{square:.1f} across; give angles and size of one mode of the camera"
            )
        falling = all(a > b for a, b in zip(self.horizons, self.horizons[1:], strict=False))
        if not self.horizons or not falling or not all(abs(v) < 1.5 for v in self.horizons):
            raise ValueError(
                f"found horizons {list(self.horizons)}, expected tilts in rad, each below the last"
            )

    @property
    def tilts(self) -> bool:
        """Whether it looks from more than one horizon."""
        return len(self.horizons) > 1

    @property
    def on_mast(self) -> bool:
        """Whether it sits on a mast: above all that a TurtleBot 4 has as it is sold."""
        return self.z > TURTLEBOT4_TOP_M

    @property
    def focal_share(self) -> tuple[float, float]:
        """Focal length as a share of the picture's width, and of its height."""
        x, y = (0.5 / math.tan(math.radians(fov) / 2) for fov in self.fov_deg)
        return x, y

    def __str__(self) -> str:
        (wide, high), (width, height) = self.fov_deg, self.size
        down = [f"{math.degrees(at):g}" for at in self.horizons]
        looks = f"tilts to {' and '.join(down)} degrees" if self.tilts else "does not tilt"
        return (
            f"{wide:.0f} x {high:.0f} degrees, {width} x {height} pixels, {self.z:g} m up, {looks}"
        )

    def differs(self, fov_deg: tuple[float, float], size: tuple[int, int]) -> str:
        """How pictures of another field of view or shape differ, "" when they are this camera's.

        Args:
            fov_deg: horizontal and vertical, degrees.
            size: width and height, pixels; only their ratio matters.
        """
        own, other = self.size[0] / self.size[1], size[0] / size[1]
        same_view = all(
            abs(a - b) <= FOV_TOLERANCE_DEG for a, b in zip(fov_deg, self.fov_deg, strict=True)
        )
        if same_view and abs(other / own - 1) <= ASPECT_TOLERANCE:
            return ""
        return (
            f"a view of {fov_deg[0]:.0f} x {fov_deg[1]:.0f} degrees in {size[0]} x {size[1]} pixels"
        )

    def sees_like(self, other: CameraSetUp) -> bool:
        """Whether pictures of both show the same, in however many pixels."""
        places = [(camera.x, camera.z, camera.horizons) for camera in (self, other)]
        return places[0] == places[1] and not self.differs(other.fov_deg, other.size)

    def to_json(self) -> dict[str, Any]:
        """Plain values, with horizons in degrees as people read them."""
        return {
            "x": self.x, "z": self.z, "fov_deg": list(self.fov_deg), "size": list(self.size),
            "horizons_deg": [round(math.degrees(at), 6) for at in self.horizons],
        }  # fmt: skip

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> CameraSetUp:
        """What ``to_json`` gave.

        Raises:
            ValueError: something is missing, unknown or makes no sense.
        """
        known = {"x", "z", "fov_deg", "size", "horizons_deg"}
        if set(values) != known:
            odd = sorted(set(values) ^ known)
            raise ValueError(f"found a camera with or without {odd}, expected {sorted(known)}")
        try:
            (wide, high), (width, height) = values["fov_deg"], values["size"]
            horizons = tuple(math.radians(at) for at in values["horizons_deg"])
            view = float(wide), float(high)
            return cls(float(values["x"]), float(values["z"]), view, (width, height), horizons)
        except TypeError as error:
            raise ValueError(f"found a camera that is no such ({error})") from error

    @classmethod
    def read(cls, name: str) -> CameraSetUp:
        """One of ``CAMERAS`` by name, or a JSON file of the same fields.

        Raises:
            ValueError: there is no such name and no such file, or the file makes no sense.
        """
        if name in CAMERAS:
            return CAMERAS[name]
        try:
            return cls.from_json(json.loads(Path(name).read_text()))
        except OSError as error:
            raise ValueError(
                f"found camera {name!r}, expected {', '.join(CAMERAS)} or a JSON file: {error}"
            ) from error
        except (ValueError, AttributeError) as error:
            raise ValueError(f"found no usable camera in {name}: {error}") from error


MAST = CameraSetUp(0.0, 1.3, (90.0, 90.0), (300, 300), (0.0, -math.radians(30.0)))
"""The paper's view, on a mast. All built-in rooms were seen so before scenes said by what."""

CAMERAS: Mapping[str, CameraSetUp] = MappingProxyType({
    "mast": MAST,
    # OAK-D on its bracket (turtlebot4_description); its preview is a square cut out of 1080P
    # (turtlebot4_bringup, oakd_pro.yaml)
    "stock_preview": CameraSetUp(-0.06, 0.244, (40.0, 40.0), (250, 250), (0.0,)),
    # the whole colour picture of 16:9, 66 degrees across (Luxonis, OAK-D Pro, RGB), which is
    # published in 1280x720 and averaged by whoever looks at it
    "stock_wide": CameraSetUp(-0.06, 0.244, (66.0, 40.1), (448, 252), (0.0,)),
    # OAK-D Lite on the Lite's bracket (turtlebot4_description, lite). 16:9 is read from 3840x2160
    # of the sensor's 4208x3120 pixels, which see 69 degrees across (Luxonis, IMX214, PY047)
    "lite": CameraSetUp(-0.037, 0.186, (64.2, 38.9), (448, 252), (0.0,)),
})  # fmt: skip
"""The mast, the TurtleBot 4 as it is sold, by its small square picture and by its whole one, and
the Lite by its whole one."""
