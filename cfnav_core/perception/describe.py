"""Write into an ONNX file what it perceives, so that it can be driven without knowing who made it.

A detector or encoder of one's own becomes a perception by a line of this:
``describe(Path("encoder.onnx"), objects, fields, camera)``.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import onnx

from cfnav_core.perception.perception import METADATA
from cfnav_core.task.camera import CameraSetUp
from cfnav_core.task.detections import Fields


def describe(
    path: Path, objects: Sequence[str], fields: Fields, camera: CameraSetUp | None
) -> None:
    """Say in an ONNX file what its detections are of, what their numbers mean, and of which camera.

    Args:
        path: takes ``pictures`` uint8 [n, H, W, 3] and gives ``features`` float32 [n, ...] and, if
            it detects anything, ``detections`` float32 [n, C, D].
        objects: names of the C rows.
        fields: names of the D columns, see ``task.detections``.
        camera: whose pictures it was made for; None when any will do.

    Raises:
        OSError: the file cannot be read or written.
    """
    network = onnx.load(path)
    text = {"objects": list(objects), "fields": list(fields)}
    said = text | ({"camera": camera.to_json()} if camera else {})
    onnx.helper.set_model_props(network, {METADATA: json.dumps(said)})
    onnx.save(network, path)
