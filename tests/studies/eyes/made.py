"""Networks of a few nodes and pictures of one colour."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

import numpy as np
import onnx
import yaml
from onnx import TensorProto, helper, numpy_helper
from PIL import Image

from cfnav_core.perception.describe import describe

RED, BLUE, GREY = (250, 0, 0), (0, 0, 250), (90, 90, 90)


def save(nodes, given, wanted, constants, path: Path) -> Path:
    """Write a network of nodes with constants by name."""
    tensors = [numpy_helper.from_array(value, name) for name, value in constants.items()]
    graph = helper.make_graph(nodes, "made", given, wanted, tensors)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    onnx.save(model, path)
    return path


def colour_perception(path: Path, side: int = 8, objects=("Apple", "Mug")) -> Path:
    """A perception to which red pictures show an Apple and blue ones a Mug."""
    save(
        [
            helper.make_node("Cast", ["pictures"], ["numbers"], to=TensorProto.FLOAT),
            helper.make_node("ReduceMean", ["numbers"], ["mean"], axes=[1, 2], keepdims=0),
            helper.make_node("Div", ["mean", "most"], ["features"]),
            helper.make_node("Gather", ["features", "ends"], ["two"], axis=1),
            helper.make_node("Unsqueeze", ["two", "last"], ["detections"]),
        ],
        [helper.make_tensor_value_info("pictures", TensorProto.UINT8, ["n", side, side, 3])],
        [
            helper.make_tensor_value_info("features", TensorProto.FLOAT, ["n", 3]),
            helper.make_tensor_value_info("detections", TensorProto.FLOAT, ["n", 2, 1]),
        ],
        {"most": np.float32(255), "ends": np.array([0, 2]), "last": np.array([2])},
        path,
    )
    describe(path, objects, ("score",), None)
    return path


def constant_detector(path: Path, rows: list[list[float]]) -> Path:
    """A CenterNet that finds the same in every picture: x0, y0, x1, y1 of 512, score, class."""
    return save(
        [
            helper.make_node("ReduceMean", ["tower_0/images:0"], ["mean"], keepdims=0),
            helper.make_node("Mul", ["mean", "none"], ["zero"]),
            helper.make_node("Add", ["rows", "zero"], ["tower_0/detections:0"]),
        ],
        [helper.make_tensor_value_info("tower_0/images:0", TensorProto.FLOAT, [1, 512, 512, 3])],
        [helper.make_tensor_value_info("tower_0/detections:0", TensorProto.FLOAT, None)],
        {"none": np.float32(0), "rows": np.array([rows], np.float32)},
        path,
    )


def table(folder: Path, pictures: dict[str, tuple[tuple[int, int, int], dict]]) -> Path:
    """Write pictures of one colour into a cache, and a table that tells them; returns its path."""
    (folder / "pictures").mkdir(parents=True)
    rows = []
    for name, (colour, row) in pictures.items():
        path = folder / "pictures" / f"{name}.png"
        Image.new("RGB", (24, 16), colour).save(path)
        rows.append({
            "name": name, "package": "own", "path": f"{name}.png", "size": [24, 16],
            "sha256": sha256(path.read_bytes()).hexdigest(), "kind": "room", "note": "one colour",
            "shown": [], **row,
        })  # fmt: skip
    own = {"registry": "npm", "name": "own", "version": "1", "licence": "ours"}
    path = folder / "pictures.yaml"
    path.write_text(yaml.safe_dump({"packages": {"own": own}, "pictures": rows}))
    return path
