"""A perception of a few nodes, and picture sets of bright squares."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from cfnav_core.perception.describe import describe
from cfnav_core.perception.picture_set import PictureSet
from cfnav_core.perception.sight import Sight
from cfnav_core.task.camera import CameraSetUp
from cfnav_core.task.vocabulary import CATEGORIES

SMALL = CameraSetUp(0.0, 0.3, (60.0, 42.1), (96, 64), (0.0,))
"""A camera of small pictures, wider than high."""


def colour_maps(path: Path, cell: int = 8, at_once: str | int = "n") -> Path:
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
        [helper.make_tensor_value_info("pictures", TensorProto.UINT8, [at_once, 24, 32, 3])],
        [helper.make_tensor_value_info(n, TensorProto.FLOAT, s) for n, s in shapes.items()],
        [numpy_helper.from_array(value, name) for name, value in constants.items()],
    )  # fmt: skip
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    onnx.save(model, path)
    describe(path, ("Apple", "Mug"), ("score",), None)
    return path


def picture_set(folder, seed, camera=SMALL, count=24, kind="kitchen"):
    """A room in which a bright square in the left half is a Mug, in the right half a Bowl."""
    sight, rng = Sight.of(camera), np.random.default_rng(seed)
    rows, columns = sight.heat
    pictures = rng.integers(0, 60, (count, *sight.picture, 3), np.uint8)
    heat = np.zeros((count, rows, columns, len(CATEGORIES)), np.uint8)
    for k in range(count):
        row, column = int(rng.integers(rows)), int(rng.integers(columns))
        pictures[k, 8 * row : 8 * row + 8, 8 * column : 8 * column + 8] = 250
        thing = CATEGORIES.index("Mug" if column < columns / 2 else "Bowl")
        heat[k, row, column, thing] = 255
    sizes = (count, *sight.coarse)
    PictureSet(
        pictures, heat, heat, np.full(sizes, 2.0, np.float16), np.zeros(sizes, np.uint8),
        CATEGORIES, camera,
    ).save(folder / f"{kind}_{seed:05d}")  # fmt: skip
