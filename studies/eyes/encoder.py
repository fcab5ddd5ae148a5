"""Cut NanoDet's backbone out as an image encoder: ``python -m studies.eyes.encoder``.

The file takes ``pictures`` uint8 [n, side, side, 3] in RGB and gives ``features`` float32
[n, 512, side/32, side/32], rounded up, of a network that learnt from COCO's photographs. It is told
as a perception that detects nothing, so that ``cfnav rooms make --perception`` takes it.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from cfnav_core.command import run_options
from cfnav_core.perception.describe import describe
from cfnav_core.perception.onnx_session import open_session
from studies.eyes.detectors import BGR_DEVIATION, BGR_MEAN
from studies.eyes.fetch import CACHE

CHANNELS = 512
"""Of the last stage of the backbone."""

TIMED = 30


@dataclass(frozen=True)
class EncoderOptions:
    """Cut the backbone out of a NanoDet in an ONNX file."""

    detector: Path = CACHE / "detectors/nanodet.onnx"
    """NanoDet (python -m studies.eyes.fetch --detectors)."""
    out: Path = CACHE / "encoders"
    """Folder of the encoders."""
    side: tuple[int, ...] = (150, 224, 416)
    """Sides of the pictures, pixels; a file for each."""


def last_stage(graph: onnx.GraphProto) -> str:
    """Name of the backbone's last output: 512 channels a thirty-second of the picture's side.

    Raises:
        ValueError: there is none, so this is another network.
    """
    shapes = {
        value.name: [d.dim_value for d in value.type.tensor_type.shape.dim]
        for value in graph.value_info
    }
    joined = [node.output[0] for node in graph.node if node.op_type == "Concat"]
    found = [name for name in joined if shapes.get(name, [0, 0])[1] == CHANNELS]
    if len(found) != 1:
        raise ValueError(
            f"found {len(found)} outputs of {CHANNELS} channels, expected the one of NanoDet's "
            "backbone; give the nanodet.onnx of python -m studies.eyes.fetch --detectors"
        )
    return found[0]


def cut(detector: Path, out: Path, side: int) -> None:
    """Write the encoder for pictures of one size.

    Raises:
        ValueError: the detector is another network.
        OSError: a file cannot be read or written.
    """
    network = onnx.shape_inference.infer_shapes(onnx.load(detector))
    end = last_stage(network.graph)
    backbone = onnx.utils.Extractor(network).extract_model(["input_1:0"], [end])
    graph = backbone.graph
    constants = {
        "bgr": np.array([2, 1, 0]),
        "mean": BGR_MEAN.reshape(1, 3, 1, 1),
        "deviation": BGR_DEVIATION.reshape(1, 3, 1, 1),
    }
    graph.initializer.extend(numpy_helper.from_array(v, k) for k, v in constants.items())
    before = [
        helper.make_node("Gather", ["pictures", "bgr"], ["blue_first"], axis=3),
        helper.make_node("Cast", ["blue_first"], ["numbers"], to=TensorProto.FLOAT),
        helper.make_node("Transpose", ["numbers"], ["planes"], perm=[0, 3, 1, 2]),
        helper.make_node("Sub", ["planes", "mean"], ["centred"]),
        helper.make_node("Div", ["centred", "deviation"], ["input_1:0"]),
    ]
    nodes = [*before, *graph.node, helper.make_node("Identity", [end], ["features"])]
    cells = -(-side // 32)
    taken = helper.make_tensor_value_info("pictures", TensorProto.UINT8, ["n", side, side, 3])
    given = helper.make_tensor_value_info(
        "features", TensorProto.FLOAT, ["n", CHANNELS, cells, cells]
    )
    made = helper.make_graph(nodes, "encoder", [taken], [given], list(graph.initializer))
    model = helper.make_model(made, opset_imports=backbone.opset_import)
    model.ir_version = backbone.ir_version
    onnx.checker.check_model(model)
    out.parent.mkdir(parents=True, exist_ok=True)
    onnx.save(model, out)
    describe(out, (), (), None)


def milliseconds(path: Path, side: int) -> float:
    """Median wall time of one picture on one thread."""
    session = open_session(path)
    picture = np.random.default_rng(0).integers(0, 256, (1, side, side, 3), np.uint8)
    times = []
    for _ in range(TIMED):
        begun = time.perf_counter()
        session.run(["features"], {"pictures": picture})
        times.append(time.perf_counter() - begun)
    return float(np.median(times)) * 1e3


def main(options: EncoderOptions) -> None:
    """Cut, time and print.

    Raises:
        ValueError: the detector is another network.
    """
    for side in options.side:
        path = options.out / f"nanodet_backbone_{side}.onnx"
        cut(options.detector, path, side)
        shape = CHANNELS, -(-side // 32), -(-side // 32)
        print(f"{path}: {shape}, {milliseconds(path, side):.0f} ms a picture, one thread")


if __name__ == "__main__":
    sys.exit(run_options("encoder", EncoderOptions, main))
