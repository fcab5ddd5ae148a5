"""Weights of an ONNX file in half as many bytes: float16 in the file, float32 at work."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

LEAST = 1024
"""Numbers of a matrix from which it is worth halving."""


def halve_weights(path: Path) -> None:
    """Store the large matrices of a network as float16, under their names.

    They are made float32 when it is opened, so it is as fast as before; what it says changes by
    what their rounding does.

    Args:
        path: the ONNX file, which is written over.

    Raises:
        OSError: it cannot be read or written.
    """
    network = onnx.load(path)
    graph = network.graph
    wide: dict[str, str] = {}
    for weight in graph.initializer:
        large = len(weight.dims) > 1 and math.prod(weight.dims) >= LEAST
        if large and weight.data_type == TensorProto.FLOAT:
            wide[weight.name] = f"{weight.name}.float32"
            half = numpy_helper.to_array(weight).astype(np.float16)
            weight.CopyFrom(numpy_helper.from_array(half, weight.name))
    for node in graph.node:
        node.input[:] = [wide.get(name, name) for name in node.input]
    nodes = list(graph.node)
    del graph.node[:]
    graph.node.extend(
        helper.make_node("Cast", [name], [of], to=TensorProto.FLOAT) for name, of in wide.items()
    )
    graph.node.extend(nodes)
    onnx.save(network, path)
