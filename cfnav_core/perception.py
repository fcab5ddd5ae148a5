"""``Perception``: one RGB picture to features and detections, on ONNX Runtime.

The same object renders the features of a data set and answers on the robot. Its network is made
by ``train_perception`` and travels inside every bundle as ``perception.onnx``.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from cfnav_core.onnx_session import open_session
from cfnav_core.vocabulary import CATEGORIES

INPUT_SIZE = 150
"""Side of the network's input, pixels; a 300x300 picture is averaged 2x2."""

FEATURES = 256
DETECTION_FIELDS = ("score", "x", "y", "size", "near")
"""Per category: confidence 0..1; centre in -1..1 (right and down positive), times score; square
root of the seen share of the picture; confidence that it is visible (within 1.5 m)."""


class PerceptionError(ValueError):
    """A picture or a network file cannot be used; the message says what was expected."""


@dataclass(frozen=True)
class Observation:
    """What the policy sees of N pictures.

    Attributes:
        features: float16 [N, 256].
        detections: float16 [N, C, 5], see ``DETECTION_FIELDS``.
    """

    features: np.ndarray
    detections: np.ndarray


def check_size(height: int, width: int) -> None:
    """Raise PerceptionError when pictures of a size, pixels, cannot be used."""
    if min(height, width) < INPUT_SIZE or abs(height - width) > 0.01 * max(height, width):
        raise PerceptionError(
            f"found a picture of {width}x{height} pixels, expected a square one of at least "
            f"{INPUT_SIZE}x{INPUT_SIZE}; crop or pad it first"
        )


def preprocess(rgb: np.ndarray) -> np.ndarray:
    """Scale a picture to the network's input by averaging, whatever its size.

    Each pixel becomes the mean of those whose centres it covers: 2x2 of 300x300, one or two either
    way of 250x250. Nothing else is adapted. The network learnt from a camera of 90 degrees at
    1.3 m: in a picture of another (the TurtleBot 4's preview has about 40 degrees and 250x250
    pixels) things are larger and elsewhere, and its features and "visible within 1.5 m" mean
    something else.

    Args:
        rgb: uint8 [H, W, 3], square within one pixel in a hundred, at least 150 high.

    Returns:
        uint8 [150, 150, 3].

    Raises:
        PerceptionError: another dtype or shape.
    """
    if rgb.dtype != np.uint8 or rgb.ndim != 3 or rgb.shape[2] != 3:
        raise PerceptionError(f"found a picture {rgb.dtype} {rgb.shape}, expected uint8 [H, W, 3]")
    h, w = rgb.shape[:2]
    check_size(h, w)
    if h == w == INPUT_SIZE:
        return np.ascontiguousarray(rgb)
    return np.asarray(Image.fromarray(rgb).resize((INPUT_SIZE, INPUT_SIZE), Image.Resampling.BOX))


class Perception:
    """The perception network.

    Args:
        path: ``perception.onnx``.
        threads: threads of ONNX Runtime.

    Raises:
        PerceptionError: the file is missing, damaged or of another shape.
    """

    def __init__(self, path: Path, threads: int = 1) -> None:
        try:
            content = path.read_bytes()
            self._session = open_session(content, threads)
        except (OSError, ValueError) as error:
            raise PerceptionError(
                f"found no usable perception network at {path} ({error}); make one with "
                "python -m cfnav_core.train_perception or take the shipped bundle's"
            ) from error
        outputs = [(o.name, tuple(o.shape[1:])) for o in self._session.get_outputs()]
        expected = [
            ("features", (FEATURES,)), ("detections", (len(CATEGORIES), len(DETECTION_FIELDS)))
        ]  # fmt: skip
        if outputs != expected:
            raise PerceptionError(
                f"found outputs {outputs} in {path}, expected {expected}; the network was made "
                "for another version"
            )
        self.identity = hashlib.sha256(content).hexdigest()[:16]
        """First 16 hex digits of the file's SHA-256; scenes and bundles carry it."""

    def __call__(self, pictures: np.ndarray) -> Observation:
        """Observe pictures.

        Args:
            pictures: uint8 [N, 150, 150, 3] from ``preprocess``.

        Returns:
            Observation, rounded to float16 as stored in scenes, so that the robot sees no more
            digits than training did.
        """
        features, detections = self._session.run(None, {"pictures": pictures})
        return Observation(features.astype(np.float16), detections.astype(np.float16))

    def observe(self, rgb: np.ndarray) -> Observation:
        """Observe one picture, uint8 [H, W, 3] of any supported size."""
        return self(preprocess(rgb)[None])
