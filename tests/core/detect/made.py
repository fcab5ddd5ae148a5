"""Detectors that find the same in every picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper

from tests.studies.eyes.made import save


def constant_network(
    path: Path, outputs: Mapping[str, np.ndarray], shape: Sequence[int | str] = (1, 3, 32, 64),
    given: str = "images", kind: int = TensorProto.FLOAT, said: Mapping[str, str] | None = None,
    asks: str = "", varies: float = 0.0,
) -> Path:  # fmt: skip
    """Write a network whose outputs hardly depend on what it is given.

    Args:
        path: of the file.
        outputs: constants by name.
        shape: of the input ``given``.
        given: name of the input.
        kind: of its numbers.
        said: what the file says of itself.
        varies: by which the mean of what it is given moves all outputs.
        asks: name of a second input, the size of the picture; its numbers scale no box.
    """
    nodes = [
        helper.make_node("Cast", [given], ["numbers"], to=TensorProto.FLOAT),
        helper.make_node("ReduceMean", ["numbers"], ["mean"], keepdims=0),
        helper.make_node("Mul", ["mean", "none"], ["zero"]),
    ]
    for k, (name, value) in enumerate(outputs.items()):
        zero = f"zero_{k}"
        nodes.append(helper.make_node("Cast", ["zero"], [zero], to=_kind(value)))
        nodes.append(helper.make_node("Add", [f"value_{k}", zero], [name]))
    inputs = [helper.make_tensor_value_info(given, kind, shape)]
    if asks:
        inputs.append(helper.make_tensor_value_info(asks, TensorProto.INT64, [1, 2]))
    wanted = [
        helper.make_tensor_value_info(name, _kind(value), value.shape)
        for name, value in outputs.items()
    ]
    values = {f"value_{k}": value for k, value in enumerate(outputs.values())}
    save(nodes, inputs, wanted, {"none": np.float32(varies), **values}, path)
    if said:
        model = onnx.load(path)
        helper.set_model_props(model, dict(said))
        onnx.save(model, path)
    return path


def _kind(value: np.ndarray) -> int:
    return int(helper.np_dtype_to_tensor_dtype(value.dtype))
