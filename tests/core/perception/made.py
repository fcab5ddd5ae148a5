"""A perception of a few nodes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from cfnav_core.perception.describe import describe


def colour_maps(path: Path, cell: int = 8) -> Path:
    """A perception of pictures 32x24 to which red shows an Apple and blue a Mug, and where."""
    nodes = [
        helper.make_node("Cast", ["pictures"], ["numbers"], to=TensorProto.FLOAT),
        helper.make_node("Transpose", ["numbers"], ["planes"], perm=[0, 3, 1, 2]),
        helper.make_node("Div", ["planes", "most"], ["shares"]),
        helper.make_node("Gather", ["shares", "ends"], ["two"], axis=1),
        helper.make_node(
            "AveragePool", ["two"], ["shown"], kernel_shape=[cell] * 2, strides=[cell] * 2
        ),
        helper.make_node("ReduceMax", ["shown"], ["features"], axes=[2, 3], keepdims=0),
        helper.make_node("ReduceMax", ["shown"], ["best"], axes=[3], keepdims=0),
        helper.make_node("ReduceMax", ["best"], ["detections"], axes=[2], keepdims=1),
    ]
    shapes = {"features": ["n", 2], "detections": ["n", 2, 1]}
    shapes["shown"] = ["n", 2, 24 // cell, 32 // cell]
    constants = {"most": np.float32(255), "ends": np.array([0, 2])}
    graph = helper.make_graph(
        nodes, "made",
        [helper.make_tensor_value_info("pictures", TensorProto.UINT8, ["n", 24, 32, 3])],
        [helper.make_tensor_value_info(n, TensorProto.FLOAT, s) for n, s in shapes.items()],
        [numpy_helper.from_array(value, name) for name, value in constants.items()],
    )  # fmt: skip
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    onnx.save(model, path)
    describe(path, ("Apple", "Mug"), ("score",), None)
    return path
