"""``Perception``: one RGB picture to features and detections.

The interface between pictures and everything that decides. ``OnnxPerception`` runs any ONNX file
that takes pictures and gives features, and detections if it has any; the built-in network is one
(``perception.train`` makes it). The same object renders the features of a data set and answers on
the robot.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from PIL import Image

from cfnav_core.perception.boxes import LEAST, Detection, decode
from cfnav_core.perception.onnx_session import open_session
from cfnav_core.perception.sight import Sight, cells
from cfnav_core.task.camera import ASPECT_TOLERANCE, MAST, CameraSetUp
from cfnav_core.task.detections import SCORES, Fields, width
from cfnav_core.task.vocabulary import CATEGORIES, FIRST_CATEGORIES

FEATURES = 256
"""Numbers that the built-in network makes of a picture, besides its detections."""

MAPS = "shown"
"""Output of a network that tells where in the picture each object is shown."""

AT_ONCE = 8
"""Pictures that a network looks at together: so many fit into a core's cache, and 64 take up to
half as long again. The numbers are the same."""

BUNDLES = Path(__file__).parents[1] / "bundles"
NETWORKS = {
    "mast": BUNDLES / "default/perception.onnx",
    "stock_wide": BUNDLES / "turtlebot4/perception.onnx",
}
"""Networks that give boxes, by the camera whose pictures they learnt from; MAST.md and so on beside
this file say how. The bundles of the paper's tables drive by an older one that gives none. A newer
one for the mast, mast.onnx, is for policies that learn with it."""

METADATA = "cfnav"
"""Key under which an ONNX file says what it perceives, as JSON; see ``describe``."""


class PerceptionError(ValueError):
    """A picture or a network file cannot be used; the message says what was expected."""


@dataclass(frozen=True)
class Perceived:
    """What the policy sees of N pictures.

    Attributes:
        features: float16 [N, *F].
        detections: float16 [N, C, D].
    """

    features: np.ndarray
    detections: np.ndarray


@dataclass(frozen=True)
class Percept:
    """What a perception gives, and from what.

    Attributes:
        features: F, shape of a picture's features.
        objects: names of the C rows of its detections; empty when it detects nothing.
        fields: names of the D columns, see ``task.detections``.
        size: height and width of the pictures that the network takes, pixels.
        camera: whose pictures it was made for; None when it does not say.
    """

    features: tuple[int, ...]
    objects: tuple[str, ...]
    fields: Fields
    size: tuple[int, int]
    camera: CameraSetUp | None

    def check_size(self, height: int, width: int) -> None:
        """Raise PerceptionError when pictures of a size, pixels, cannot be used."""
        own_height, own_width = self.size
        aspect = (width / max(height, 1)) / (own_width / own_height)
        if height < own_height or width < own_width or abs(aspect - 1) > ASPECT_TOLERANCE:
            shape = "a square one" if own_height == own_width else "one of that shape"
            raise PerceptionError(
                f"found a picture of {width}x{height} pixels, expected {shape} of at least "
                f"{own_width}x{own_height}; crop or pad it first"
            )

    def preprocess(self, rgb: np.ndarray) -> np.ndarray:
        """Scale a picture to the network's input by averaging, whatever its size.

        Each pixel becomes the mean of those whose centres it covers: 2x2 of 300x300 for the
        built-in network, one or two either way of 250x250. Nothing else is adapted: in a picture
        of another camera things are larger and elsewhere, and mean something else.

        Args:
            rgb: uint8 [H, W, 3] of the network's shape, within two parts in a hundred, and no
                smaller.

        Returns:
            uint8 [*size, 3].

        Raises:
            PerceptionError: another dtype or shape.
        """
        if rgb.dtype != np.uint8 or rgb.ndim != 3 or rgb.shape[2] != 3:
            raise PerceptionError(
                f"found a picture {rgb.dtype} {rgb.shape}, expected uint8 [H, W, 3]"
            )
        self.check_size(*rgb.shape[:2])
        if rgb.shape[:2] == self.size:
            return np.ascontiguousarray(rgb)
        # Pillow: bundles learnt from its means, and OpenCV's differ, at 2x2 by one level.
        return np.asarray(Image.fromarray(rgb).resize(self.size[::-1], Image.Resampling.BOX))


def built_in(camera: CameraSetUp) -> Percept:
    """What ``perception.train`` makes for a camera."""
    return Percept((FEATURES,), CATEGORIES, SCORES, Sight.of(camera).picture, camera)


BUILT_IN = built_in(MAST)
"""The same, seen from the mast."""


class Perception(Protocol):
    """From pictures to what policies read. ``identity`` tells apart what sees differently."""

    identity: str
    gives: Percept

    def __call__(self, pictures: np.ndarray) -> Perceived:
        """Observe pictures, uint8 [N, *size, 3] from ``Percept.preprocess``."""
        ...

    def observe(self, rgb: np.ndarray) -> Perceived:
        """Observe one picture, uint8 [H, W, 3] of any size that fits."""
        ...


class OnnxPerception:
    """A perception network in an ONNX file.

    It takes ``pictures`` uint8 [n, H, W, 3], and gives ``features`` float32 [n, *F] and, if it
    detects anything, ``detections`` float32 [n, C, D]. What C and D mean it says itself. One that
    also gives ``shown`` float32 [n, C, *Q], probabilities in cells of the picture, has boxes.

    Args:
        path: ``perception.onnx``.
        threads: threads of ONNX Runtime.

    Raises:
        PerceptionError: the file is missing, damaged, or does not say what it detects.
    """

    def __init__(self, path: Path, threads: int = 1) -> None:
        try:
            content = path.read_bytes()
            self._session = open_session(content, threads)
        except (OSError, ValueError) as error:
            raise PerceptionError(
                f"found no usable perception network at {path} ({error}); make one with "
                "cfnav perception, or take the shipped bundle's"
            ) from error
        self.identity = hashlib.sha256(content).hexdigest()[:16]
        """First 16 hex digits of the file's SHA-256; scenes and bundles carry it."""
        self._path = path
        self.gives = self._said(path)
        self._detects = bool(self.gives.objects)

    def _said(self, path: Path) -> Percept:
        inputs = {i.name: (i.type, tuple(i.shape)) for i in self._session.get_inputs()}
        outputs = {o.name: tuple(o.shape[1:]) for o in self._session.get_outputs()}
        kind, taken = inputs.get("pictures", ("", ()))
        whole = all(isinstance(n, int) for n in (*taken[1:], *outputs.get("features", ("",))))
        if kind != "tensor(uint8)" or len(taken) != 4 or taken[3] != 3 or not whole:
            raise PerceptionError(
                f"found inputs {inputs} and outputs {outputs} in {path}, expected pictures uint8 "
                "[n, H, W, 3] and features [n, ...] of fixed size"
            )
        if isinstance(taken[0], int):
            raise PerceptionError(
                f"found a network in {path} that takes {taken[0]} pictures at a time, expected any "
                "number: export it with an axis of that name (torch.onnx.export, dynamic_axes)"
            )
        text = self._session.get_modelmeta().custom_metadata_map.get(METADATA)
        table = outputs.get("detections", ())
        try:
            said: dict[str, Any] = json.loads(text) if text else _before_metadata(table)
            camera = said.get("camera")
            percept = Percept(
                outputs["features"], tuple(said["objects"]), tuple(said["fields"]),
                (int(taken[1]), int(taken[2])), CameraSetUp.from_json(camera) if camera else None,
            )  # fmt: skip
            shape = (len(percept.objects), width(percept.fields)) if percept.objects else ()
        except (ValueError, KeyError, TypeError) as error:
            raise PerceptionError(
                f"found no readable account of what {path} perceives ({error}); write it with "
                "cfnav_core.perception.describe"
            ) from error
        if table != shape:
            raise PerceptionError(
                f"found detections {list(table)} in {path}, expected {list(shape)}: "
                f"{len(percept.objects)} objects by {', '.join(percept.fields)}"
            )
        return percept

    def __call__(self, pictures: np.ndarray) -> Perceived:
        """See ``Perception``.

        Returns:
            Observation, rounded to float16 as stored in scenes, so that the robot sees no more
            digits than training did.
        """
        names = ["features", "detections"] if self._detects else ["features"]
        parts = np.array_split(pictures, range(AT_ONCE, len(pictures), AT_ONCE))
        said = [self._session.run(names, {"pictures": part}) for part in parts]
        features, *table = map(np.concatenate, zip(*said, strict=True))
        detections = table[0] if table else np.empty((len(pictures), 0, 0))
        return Perceived(features.astype(np.float16), detections.astype(np.float16))

    def observe(self, rgb: np.ndarray) -> Perceived:
        """See ``Perception``."""
        return self(self.gives.preprocess(rgb)[None])

    def boxes(self, rgb: np.ndarray, least: float = LEAST) -> list[Detection]:
        """Named detections with boxes in pixels of a picture, best first.

        Args:
            rgb: uint8 [H, W, 3] of any size that fits.
            least: score.

        Raises:
            PerceptionError: the picture does not fit, or the network gives no boxes.
        """
        height, width = rgb.shape[:2]
        shown = self.maps(rgb)
        return decode(shown, self.gives.objects, self.gives.size, (width, height), least)

    def maps(self, rgb: np.ndarray) -> np.ndarray:
        """Where in a picture each object is shown: float32 [C, *Q], 0..1, see ``boxes.decode``.

        Args:
            rgb: uint8 [H, W, 3] of any size that fits.

        Raises:
            PerceptionError: the picture does not fit, or the network gives no boxes.
        """
        if self.no_boxes:
            raise PerceptionError(self.no_boxes)
        pictures = self.gives.preprocess(rgb)[None]
        (shown,) = self._session.run([MAPS], {"pictures": pictures})
        return np.asarray(shown[0])

    @property
    def no_boxes(self) -> str:
        """Why it gives no boxes, one sentence; "" when it does."""
        shapes = {o.name: tuple(o.shape[1:]) for o in self._session.get_outputs()}
        expected = len(self.gives.objects), *cells(*self.gives.size)
        if shapes.get(MAPS) == expected:
            return ""
        found = f"the output {MAPS} {list(shapes[MAPS])}" if MAPS in shapes else f"no output {MAPS}"
        return (
            f"found {found} in {self._path}, expected {list(expected)}: this perception does not "
            "tell where things are, so it gives no boxes; cfnav perception makes one that does"
        )


def _before_metadata(table: Sequence[int]) -> dict[str, Any]:
    """What a built-in network perceives that was made before files said it themselves."""
    if tuple(table) != (len(FIRST_CATEGORIES), width(SCORES)):
        raise ValueError("it says nothing of its detections")
    return {"objects": FIRST_CATEGORIES, "fields": SCORES}
