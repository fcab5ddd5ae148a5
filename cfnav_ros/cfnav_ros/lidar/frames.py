"""Frames of TF as a tree, and where a planar scanner sits in it. Pure: knows no ROS."""

from __future__ import annotations

import math

import numpy as np

from cfnav_ros.lidar.returns import Mount

LEVEL_DEG = 5.0
"""A scanner that leans further does not scan a plane along the floor."""


SAME = 1e-3
"""Entries of a transform, metres and cosines, within which one repeats another."""


class FrameTree:
    """The newest transform from each frame to its parent."""

    def __init__(self) -> None:
        self._up: dict[str, tuple[str, np.ndarray]] = {}
        self._fixed: set[str] = set()
        self._contradicted: set[str] = set()

    def add(
        self,
        parent: str,
        child: str,
        at: tuple[float, float, float],
        quaternion: tuple[float, float, float, float],
        fixed: bool = False,
    ) -> bool:
        """Take one transform.

        Args:
            parent: frame; a leading slash means nothing.
            child: frame.
            at: of the child in the parent, metres.
            quaternion: x, y, z, w of the child's axes in the parent.
            fixed: whether it is said to hold for good (``/tf_static``).

        Returns:
            Whether it was taken: not when a number is not finite or the quaternion has no length.
        """
        q = np.array(quaternion, np.float64)
        norm = float(np.linalg.norm(q))
        if not (np.isfinite(q).all() and np.isfinite(at).all() and norm > 1e-6):
            return False
        x, y, z, w = q / norm
        matrix = np.eye(4)
        matrix[:3, :3] = (
            (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
            (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
            (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
        )
        matrix[:3, 3] = at
        child, parent = child.lstrip("/"), parent.lstrip("/")
        if child in self._fixed:
            before, held = self._up[child]
            if before != parent or not np.allclose(held, matrix, atol=SAME):
                self._contradicted.add(child)
        if fixed:
            self._fixed.add(child)
        self._up[child] = (parent, matrix)
        return True

    def contradicted(self, base: str, frame: str) -> str:
        """A frame on the way between two of which TF said one thing for good, then another."""
        way = self._ancestors(base).keys() ^ self._ancestors(frame).keys()
        return min(way & self._contradicted, default="")

    def pose(self, base: str, frame: str) -> np.ndarray | None:
        """Where a frame is in another: float64 [4, 4], None while the tree does not join them."""
        above_frame, above_base = self._ancestors(frame), self._ancestors(base)
        for name, to_base in above_base.items():
            if name in above_frame:
                return np.linalg.inv(to_base) @ above_frame[name]
        return None

    def _ancestors(self, frame: str) -> dict[str, np.ndarray]:
        """A frame and those above it, nearest first, each with the frame's pose in it."""
        name, pose = frame.lstrip("/"), np.eye(4)
        found = {name: pose}
        while name in self._up:
            name, up = self._up[name]
            if name in found:  # a loop joins nothing
                break
            pose = up @ pose
            found[name] = pose
        return found


def planar_mount(pose: np.ndarray) -> Mount:
    """The mounting of a planar scanner.

    Args:
        pose: float64 [4, 4], of the scanner in base_link.

    Raises:
        ValueError: the scanner leans; one sentence.
    """
    lean = math.degrees(math.acos(min(abs(float(pose[2, 2])), 1.0)))
    if lean > LEVEL_DEG:
        raise ValueError(
            f"TF says that the LiDAR leans by {lean:.0f} degrees, expected at most {LEVEL_DEG:g}: "
            "mend the robot's description."
        )
    yaw = math.atan2(pose[1, 0], pose[0, 0])
    return Mount(float(pose[0, 3]), float(pose[1, 3]), yaw, bool(pose[2, 2] < 0))
