"""The exported bundle: a folder with ``bundle.json``, the networks as ONNX, and a model card.

Nothing in it is executable; every file's SHA-256 stands in ``bundle.json``.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SCHEMA = 2
NETWORKS = ("perception.onnx", "policy.onnx", "predictor.onnx")


class BundleError(ValueError):
    """A bundle is missing, damaged or of another version; the message says what to do."""


def shipped_bundle() -> Path:
    """Folder of the bundle that comes with the package."""
    return Path(__file__).parent / "bundles" / "default"


@dataclass(frozen=True)
class BundleHead:
    """What ``bundle.json`` holds.

    Attributes:
        name: of the bundle.
        method: row of ``methods.METHODS`` it was trained with.
        feeds_prediction: whether the policy reads p_hat; it gets zero otherwise.
        objects: what its perception looks for, in the order of its detections.
        goals: those of them that it was trained to find.
        files: SHA-256 of each network file.
        training: command, configuration, seed and commit it was made with.
        metrics: measured figures (see the model card); empty when none were measured.
    """

    name: str
    method: str
    feeds_prediction: bool
    objects: tuple[str, ...]
    goals: tuple[str, ...]
    files: dict[str, str]
    training: dict[str, Any]
    metrics: dict[str, Any]

    def save(self, folder: Path) -> None:
        """Write ``bundle.json``."""
        text = json.dumps({"schema": SCHEMA, **self.__dict__}, indent=1)
        (folder / "bundle.json").write_text(text + "\n")

    @classmethod
    def load(cls, folder: Path) -> BundleHead:
        """Read ``bundle.json`` and check every file against its hash.

        Raises:
            BundleError: missing, damaged, or of another schema.
        """
        remedy = "export it again with cfnav export, or use the shipped bundle"
        try:
            raw = json.loads((folder / "bundle.json").read_text())
            schema = raw.pop("schema")
            head = cls(**{**raw, **{key: tuple(raw[key]) for key in ("objects", "goals")}})
        except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
            raise BundleError(
                f"found no readable bundle in {folder} ({error}); {remedy}"
            ) from error
        if schema != SCHEMA:
            raise BundleError(
                f"found bundle schema {schema} in {folder}, expected {SCHEMA}; {remedy}"
            )
        for name in NETWORKS:
            path = folder / name
            found = file_hash(path) if path.is_file() else "nothing"
            if found != head.files.get(name):
                raise BundleError(
                    f"found {name} in {folder} with hash {found[:12]}, expected "
                    f"{str(head.files.get(name))[:12]}; the bundle is damaged: {remedy}"
                )
        return head


def file_hash(path: Path) -> str:
    """SHA-256 of a file, hex."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
