"""The exported bundle: a folder with ``bundle.json``, networks, their weights, and a model card.

The networks are ONNX files, which is all that a robot opens. ``weights.safetensors`` is the
checkpoint that they were made from, without its optimizer's state: torch reads it, and the ONNX
files of policy and predictor refer to it instead of holding the same numbers again. Nothing in a
bundle is executable; the SHA-256 of every file that is read stands in ``bundle.json``.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SCHEMA = 3
READABLE = (2, SCHEMA)
"""Schema 2 had no weights and did not say whether the model takes untrained goals."""

NETWORKS = ("perception.onnx", "policy.onnx", "predictor.onnx")
WEIGHTS = "weights.safetensors"

REMEDY = "export it again with cfnav export, or use the shipped bundle"

_REFERS = b"\x0a\x08location"
_TO_WEIGHTS = _REFERS + b"\x12" + bytes([len(WEIGHTS)]) + WEIGHTS.encode()
"""How an ONNX file names another that holds numbers of it, ``TensorProto.external_data`` in
protobuf: a robot has no onnx, and ONNX Runtime does not tell which files it opens."""


class BundleError(ValueError):
    """A bundle is missing, damaged or of another version; the message says what to do."""


SHIPPED = Path(__file__).parent / "bundles"
"""Bundles that come with the package, by name."""


def shipped_bundle() -> Path:
    """Folder of the bundle that drives when none is named."""
    return SHIPPED / "default"


def find_bundle(bundle: str | Path | None = None) -> Path:
    """Folder of a bundle.

    Args:
        bundle: its folder, or the name of a shipped one; nothing names the default.
    """
    if not bundle:
        return shipped_bundle()
    named = SHIPPED / bundle
    is_name = len(Path(bundle).parts) == 1 and named.is_dir()
    return named if is_name and not Path(bundle).exists() else Path(bundle)


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

    def save(self, folder: Path) -> None:
        """Write ``bundle.json``."""
        text = json.dumps({"schema": SCHEMA, **self.__dict__}, indent=1)
        (folder / "bundle.json").write_text(text + "\n")

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
            head = cls(**{**raw, **{key: tuple(raw[key]) for key in ("objects", "goals")}})
        except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
            raise BundleError(
                f"found no readable bundle in {folder} ({error}); {REMEDY}"
            ) from error
        if schema not in READABLE:
            raise BundleError(
                f"found bundle schema {schema} in {folder}, expected {SCHEMA}; {REMEDY}"
            )
        hashed = (*NETWORKS, WEIGHTS) if schema >= SCHEMA or WEIGHTS in head.files else NETWORKS
        for name in hashed:
            _check_hash(folder / name, head.files.get(name))
        for name in NETWORKS:
            _check_references(folder / name, WEIGHTS in hashed)
        return head


def _check_hash(path: Path, expected: str | None) -> None:
    found = file_hash(path) if path.is_file() else "nothing"
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


def file_hash(path: Path) -> str:
    """SHA-256 of a file, hex."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
