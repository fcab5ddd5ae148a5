"""TensorFlow.js graph to ONNX: ``python convert.py MODEL.json OUT.onnx INPUT OUTPUT...``.

Run by ``studies.eyes.fetch`` in a virtual environment of its own, as tensorflow and tf2onnx are
needed here only. Of this project it imports ``tfjs`` beside it, which needs numpy alone.
"""

from __future__ import annotations

import base64
import json
import sys
from pathlib import Path
from typing import Any

import tensorflow as tf
import tf2onnx
from google.protobuf import json_format

# last: names of modules here must hide none of tensorflow's
sys.path.append(str(Path(__file__).parent))
from tfjs import weights  # type: ignore[import-not-found]

OPSET = 17


def readable(node: dict[str, Any]) -> dict[str, Any]:
    """A node as protobuf reads it: old files hold bytes as lists of numbers."""
    for attribute in node.get("attr", {}).values():
        if isinstance(attribute.get("s"), list):
            attribute["s"] = base64.b64encode(bytes(attribute["s"])).decode()
    return node


def unfused(node: tf.compat.v1.NodeDef) -> list[tf.compat.v1.NodeDef]:
    """A convolution with bias and activation as the nodes that it was made of."""
    kind = node.op.removeprefix("_").removeprefix("Fused")
    if kind not in {"Conv2D", "DepthwiseConv2dNative"} or "fused_ops" not in node.attr:
        return [node]
    steps = ["", *(op.decode() for op in node.attr["fused_ops"].list.s)]
    found: list[tf.compat.v1.NodeDef] = []
    extra = list(node.input[2:])
    for at, op in enumerate(steps):
        name = node.name if at == len(steps) - 1 else f"{node.name}/step{at}"
        made = tf.compat.v1.NodeDef(name=name, op=op or kind)
        made.attr["T"].CopyFrom(node.attr["T"])
        if not op:
            made.input.extend(node.input[:2])
            for key in ("strides", "padding", "data_format", "dilations", "explicit_paddings"):
                if key in node.attr:
                    made.attr[key].CopyFrom(node.attr[key])
        else:
            made.input.append(found[-1].name)
            made.input.extend([extra.pop(0)] if op == "BiasAdd" else [])
        found.append(made)
    return found


def graph_def(path: Path) -> tf.compat.v1.GraphDef:
    """The graph of a ``model.json`` with its constants in it."""
    model = json.loads(path.read_text())
    values = weights(path.parent, model["weightsManifest"])
    nodes = [readable(node) for node in model["modelTopology"]["node"]]
    read = json_format.ParseDict({"node": nodes}, tf.compat.v1.GraphDef())
    graph = tf.compat.v1.GraphDef()
    graph.versions.producer = 27
    for node in read.node:
        if node.op == "Const":
            node.attr["value"].tensor.CopyFrom(tf.make_tensor_proto(values[node.name]))
            node.attr["dtype"].type = node.attr["value"].tensor.dtype
        for attribute in node.attr.values():  # JavaScript has no 64-bit integers
            if attribute.type == tf.int64.as_datatype_enum:
                attribute.type = tf.int32.as_datatype_enum
        graph.node.extend(unfused(node))
    return graph


def main(source: str, target: str, given: str, *wanted: str) -> None:
    """Convert one graph from an input to its outputs, each ``name:0``."""
    tf2onnx.convert.from_graph_def(
        graph_def(Path(source)), input_names=[given], output_names=list(wanted), opset=OPSET,
        output_path=target,
    )  # fmt: skip


if __name__ == "__main__":
    main(*sys.argv[1:])
