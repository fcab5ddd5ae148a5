"""The perception network in torch, its loss, and its export. Only training needs this file."""

from __future__ import annotations

import math
from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from cfnav_core.files.whole import whole, writing
from cfnav_core.perception.augment import Labelled
from cfnav_core.perception.describe import describe
from cfnav_core.perception.half import halve_weights
from cfnav_core.perception.perception import FEATURES, MAPS
from cfnav_core.perception.sight import FROM_MAST, Sight
from cfnav_core.perception.trunk import DEEP, FINE, Trunk
from cfnav_core.task.camera import MAST, CameraSetUp
from cfnav_core.task.detections import SCORES
from cfnav_core.task.vocabulary import CATEGORIES

MIN_CELL_PIXELS = 3
"""A cell shows a category when at least this many of its 256 full-size pixels belong to it."""


def _block(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, 1, 1, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


class PerceptionNet(nn.Module):
    """Picture -> category maps and a 256-d feature that encodes depth and free floor.

    Deliberately without a collision output: collisions are the predictor's task, and a trunk that
    was told about them would hand every method the answer.

    Args:
        objects: categories.
        sight: of the camera.
        trunk: what looks at the picture first; one with random weights when None.
    """

    def __init__(
        self, objects: int = len(CATEGORIES), sight: Sight = FROM_MAST, trunk: Trunk | None = None
    ) -> None:
        super().__init__()
        self.objects, self.sight, self.trunk = objects, sight, trunk or Trunk()
        self.fine, self.deep = _block(FINE, 64), _block(DEEP + 2, 128)
        self.detail, self.context = nn.Conv2d(64, 2 * objects, 1), nn.Conv2d(128, 2 * objects, 1)
        self.place, self.scene = nn.Conv2d(128 + 4, 128, 1), nn.Linear(FEATURES, 128)
        self.squeeze = nn.Sequential(
            nn.Conv2d(128, 24, 1), nn.ReLU(inplace=True), nn.Flatten(),
            nn.Linear(24 * math.prod(sight.coarse), FEATURES), nn.ReLU(inplace=True),
        )  # fmt: skip
        self.geometry = nn.Linear(FEATURES, 2 * math.prod(sight.coarse))
        for maps, prior in ((self.detail, -3.0), (self.context, -2.0)):
            assert maps.bias is not None
            nn.init.constant_(maps.bias, prior)
        for layer in (self.place, self.scene):  # at first they pass on what is there
            assert layer.bias is not None
            nn.init.zeros_(layer.weight)
            nn.init.zeros_(layer.bias)
        nn.init.eye_(self.place.weight[:, :128, 0, 0])
        down, across = (torch.linspace(-1, 1, cells) for cells in sight.coarse)
        where = torch.stack([across[None].expand(sight.coarse), down[:, None].expand(sight.coarse)])
        self.where: Tensor
        self.register_buffer("where", where[None])

    def forward(self, pictures: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Run the network.

        Args:
            pictures: float32 [N, 3, *P] in 0..1; P, Q and R are ``picture``, ``heat`` and
                ``coarse`` of ``sight``.

        Returns:
            logits "shown" [N, C, *Q], logits "near, if it is shown" [N, C, *Q],
            features [N, 256], geometry [N, 2, *R] (log metres; floor logit).
        """
        fine, deep = self.trunk(pictures)
        where = self.where.expand(deep.shape[0], -1, -1, -1)
        deep = self.deep(torch.cat([deep, where], 1))
        features = self.squeeze(deep)
        geometry = self.geometry(features).view(-1, 2, *self.sight.coarse)
        # How far a cell is, and how the camera tilts, only the whole picture tells.
        placed = self.place(torch.cat([deep, where, geometry], 1))
        placed = F.relu(placed + self.scene(features)[:, :, None, None])
        context = F.interpolate(self.context(placed), size=self.sight.heat, mode="nearest")
        maps = self.detail(self.fine(fine)) + context
        return maps[:, : self.objects], maps[:, self.objects :], features, geometry


def visible_here(shown: Tensor, near: Tensor) -> Tensor:
    """Log-probability that a cell shows something of a category that is near, from the logits."""
    return F.logsigmoid(shown) + F.logsigmoid(near)


def _missed(logits: Tensor, pixels: Tensor) -> Tensor:
    """How far the cells of a map are from what they are to say of the pixels in them."""
    enough = pixels >= MIN_CELL_PIXELS
    # the fullest cell of a small object counts, however few its pixels
    fullest = enough & (pixels == pixels.amax((2, 3), keepdim=True))
    target = torch.maximum((pixels / 24).clamp(max=1) * enough, fullest.float() * 0.9)
    return F.binary_cross_entropy_with_logits(logits, target, pos_weight=torch.tensor(3.0))


def _misplaced(logits: Tensor, shown: Tensor, near: Tensor) -> Tensor:
    """How far the cells that show something are from what they are to say of its distance.

    Each category counts as much as another, however large it is seen.
    """
    cells = (shown >= MIN_CELL_PIXELS).float()
    target = (near / shown.clamp(min=1)).clamp(max=1)
    wrong = F.binary_cross_entropy_with_logits(logits, target, reduction="none") * cells
    each, count = wrong.sum((2, 3)), cells.sum((2, 3))
    return (each / count.clamp(min=1)).sum() / (count > 0).sum().clamp(min=1)


def perception_loss(
    output: tuple[Tensor, Tensor, Tensor, Tensor], batch: Labelled
) -> dict[str, Tensor]:
    """Terms of the loss; the training sums them.

    Args:
        output: of ``PerceptionNet``.
        batch: what it looked at, with its labels.
    """
    shown, near, _, geometry = output
    per_cell = batch.heat[0].numel() / 40
    visible = visible_here(shown, near).amax((2, 3)).exp()
    log_depth = batch.depth.clamp(0.1, 8).log()
    return {
        "shown": per_cell * _missed(shown, batch.heat),
        "near": 10 * _misplaced(near, batch.heat, batch.near),
        "visible": 8 * F.binary_cross_entropy(visible, batch.visible),
        "depth": 8 * F.smooth_l1_loss(geometry[:, 0], log_depth, beta=0.1),
        "floor": 4 * F.binary_cross_entropy_with_logits(geometry[:, 1], batch.floor),
    }


class ExportedPerception(nn.Module):
    """The network as it is deployed: uint8 pictures in; features, detections and maps out."""

    def __init__(self, net: PerceptionNet) -> None:
        super().__init__()
        self.net = net

    def forward(self, pictures: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """uint8 [N, *P, 3] -> float32 [N, 256], [N, C, 5] (``SCORES``), [N, C, *Q] (0..1)."""
        shown, near, features, _ = self.net(pictures.permute(0, 3, 1, 2).float() / 255)
        maps = torch.sigmoid(shown)
        p = maps.flatten(2)
        score, cell = p.max(2)
        rows, columns = self.net.sight.heat
        x = (cell % columns).float() * (2 / (columns - 1)) - 1
        y = torch.div(cell, columns, rounding_mode="floor").float() * (2 / (rows - 1)) - 1
        size = p.sum(2).sqrt() / math.sqrt(rows * columns)
        visible = visible_here(shown, near).flatten(2).amax(2).exp()
        fields = torch.stack([score, x * score, y * score, size, visible], 2)
        return features, fields.reshape(-1, self.net.objects, 5), maps


def export_perception(
    net: PerceptionNet, path: Path, objects: tuple[str, ...] = CATEGORIES,
    camera: CameraSetUp = MAST,
) -> None:  # fmt: skip
    """Write ``perception.onnx`` (opset 17) for any number of pictures.

    Weights keep their names in it, so that training can begin with them, and are float16.

    Args:
        net: the network.
        path: where to.
        objects: what it detects, in the order of its maps.
        camera: that it learnt from, whose ``Sight`` is the network's.

    Raises:
        WriteError: the disk is full or refuses; what was there before stays whole.
    """
    net.eval()
    example = torch.zeros(2, *net.sight.picture, 3, dtype=torch.uint8)
    with writing(path), whole(path) as partial:
        torch.onnx.export(
            ExportedPerception(net).eval(), (example,), str(partial), dynamo=False,
            opset_version=17,
            input_names=["pictures"], output_names=["features", "detections", MAPS],
            dynamic_axes={k: {0: "n"} for k in ("pictures", "features", "detections", MAPS)},
            training=torch.onnx.TrainingMode.PRESERVE, do_constant_folding=False,
        )  # fmt: skip
        halve_weights(partial)
        describe(partial, objects, SCORES, camera)
