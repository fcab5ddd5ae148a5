"""The exported bundle: a folder with ``bundle.json``, networks, their weights, and a model card.

The networks are ONNX files, which is all that a robot opens. ``weights.safetensors`` is the
checkpoint that they were made from, without its optimizer's state: torch reads it, and the ONNX
files of policy and predictor refer to it instead of holding the same numbers again. Bundles side by
side may share a file: it then lies in ``shared`` beside them, named by its hash. Nothing in a
bundle is executable; the SHA-256 of every file that is read stands in ``bundle.json``.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cfnav_core.files.provenance import sha256
from cfnav_core.task.camera import MAST, CameraSetUp
from cfnav_core.task.detections import SCORES, SIGHTINGS, Fields
from cfnav_core.task.vocabulary import FIRST_ROOM_TYPES

SCHEMA, READABLE = 4, (2, 3, 4)
"""Schema 2 had no weights and did not say whether the model takes untrained goals; until 3 a bundle
did not say what it reads of a picture: it was the built-in perception's, seen from the mast."""

SHARED = "shared"

PERCEPTION = "perception.onnx"
NETWORKS = (PERCEPTION, "policy.onnx", "predictor.onnx")
WEIGHTS = "weights.safetensors"
CARD = "MODEL_CARD.md"

REMEDY = "export it again with cfnav export, or use the shipped bundle"

_REFERS = b"\x0a\x08location"
_TO_WEIGHTS = _REFERS + b"\x12" + bytes([len(WEIGHTS)]) + WEIGHTS.encode()
"""How an ONNX file names another that holds numbers of it, ``TensorProto.external_data`` in
protobuf: a robot has no onnx, and ONNX Runtime does not tell which files it opens."""


class BundleError(ValueError):
    """A bundle is missing, damaged or of another version; the message says what to do."""


SHIPPED = Path(__file__).parents[1] / "bundles"
"""Bundles that come with the package, by name."""


def shipped_bundle() -> Path:
    """Folder of the bundle that drives when none is named."""
    return SHIPPED / "default"


def shipped_perception() -> Path:
    """The perception network of the shipped bundle."""
    folder = shipped_bundle()
    return BundleHead.load(folder).file(folder, PERCEPTION)


def find_bundle(bundle: str | Path | None = None) -> Path:
    """Folder of a bundle.

    Args:
        bundle: its folder, or the name of a shipped one; nothing names the default.
    """
    if not bundle:
        return shipped_bundle()
    named = SHIPPED / bundle
    is_name = len(Path(bundle).parts) == 1 and (named / "bundle.json").is_file()
    return named if is_name and not Path(bundle).exists() else Path(bundle)


def bundle_elsewhere(bundle: str | Path | None = None) -> str:
    """A bundle as another process, or another machine, finds it: a shipped one by its name."""
    folder = find_bundle(bundle).resolve()
    return folder.name if folder.parent == SHIPPED.resolve() else str(folder)


TUPLES = ("objects", "goals", "features", "fields", "room_types", "further")


@dataclass(frozen=True)
class BundleHead:
    """What ``bundle.json`` holds.

    Attributes:
        name: of the bundle.
        method: row of ``methods.METHODS`` it was trained with.
        feeds_prediction: whether the policy reads p_hat; it gets zero otherwise.
        objects: what its perception looks for, in the order of its detections.
        goals: those of them that it was trained to find.
        files: SHA-256 of each network file, and of the weights where the bundle has them.
        training: command, configuration, seed and commit it was made with.
        metrics: measured figures (see the model card); empty when none were measured.
        zero_shot: whether it may be asked for any of its objects, see ``NavModel.zero_shot``.
        features: shape of the picture features that its networks read.
        fields: names of the columns of its detections, see ``task.detections``.
        room_types: that it knows, in the order of its input.
        camera: that it learnt from; None where its data do not say, or name several.
        further: those of its objects that nothing in training was (``cfnav export --also``). What
            sightings of them beside the goal's would do to it nobody knows, so one counts only
            while it is the goal.
    """

    name: str
    method: str
    feeds_prediction: bool
    objects: tuple[str, ...]
    goals: tuple[str, ...]
    files: dict[str, str]
    training: dict[str, Any]
    metrics: dict[str, Any]
    zero_shot: bool = False
    features: tuple[int, ...] = (256,)
    fields: Fields = SCORES
    room_types: tuple[str, ...] = FIRST_ROOM_TYPES
    camera: CameraSetUp | None = MAST
    further: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """As ``bundle.json`` holds it."""
        camera = self.camera.to_json() if self.camera else None
        return json.dumps({"schema": SCHEMA, **vars(self), "camera": camera}, indent=1)

    def save(self, folder: Path) -> None:
        """Write ``bundle.json``."""
        (folder / "bundle.json").write_text(self.text + "\n")

    @classmethod
    def load(cls, folder: Path) -> BundleHead:
        """Read ``bundle.json`` and check every file against its hash.

        Raises:
            BundleError: missing, damaged, of another schema, or with a network that takes numbers
                from a file without a hash.
        """
        try:
            raw = json.loads((folder / "bundle.json").read_text())
            schema = raw.pop("schema")
            raw |= {key: tuple(raw[key]) for key in TUPLES if key in raw}
            if raw.get("camera"):
                raw["camera"] = CameraSetUp.from_json(raw["camera"])
            head = cls(**raw)
        except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
            raise BundleError(
                f"found no readable bundle in {folder} ({error}); {REMEDY}"
            ) from error
        if schema not in READABLE:
            raise BundleError(
                f"found bundle schema {schema} in {folder}, expected {SCHEMA}; {REMEDY}"
            )
        has_weights = schema >= SCHEMA or WEIGHTS in head.files
        for name in (*head.networks, *[WEIGHTS] * has_weights):
            _check_hash(head.file(folder, name), head.files.get(name))
        for name in head.networks:
            _check_references(head.file(folder, name), has_weights)
        return head

    @property
    def reads_sightings(self) -> bool:
        """Whether it reads what a detector says; it then has no perception, and sees no picture."""
        return self.fields == SIGHTINGS

    @property
    def networks(self) -> tuple[str, ...]:
        """Files of the networks that it has."""
        return NETWORKS[1:] if self.reads_sightings else NETWORKS

    def file(self, folder: Path, name: str) -> Path:
        """Where one of ``files`` lies: in the bundle, or where bundles beside it share it.

        Args:
            folder: of the bundle.
            name: of the file.
        """
        own, digest = folder / name, self.files.get(name, "")
        shared = folder.parent / SHARED / f"{own.stem}-{digest[:16]}{own.suffix}"
        return shared if shared.exists() and not own.exists() else own


def _check_hash(path: Path, expected: str | None) -> None:
    found = sha256(path) if path.is_file() else "nothing"
    if found != expected:
        raise BundleError(
            f"found {path.name} in {path.parent} with hash {found[:12]}, expected "
            f"{str(expected)[:12]}; the bundle is damaged: {REMEDY}"
        )


def _check_references(network: Path, has_weights: bool) -> None:
    content = network.read_bytes()
    if content.count(_REFERS) > has_weights * content.count(_TO_WEIGHTS):
        raise BundleError(
            f"found {network.name} in {network.parent} that takes numbers from a file without a "
            f"hash, expected from {WEIGHTS} alone; {REMEDY}"
        )
