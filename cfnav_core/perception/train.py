"""Train perception: ``cfnav perception --data DIR --out perception.onnx``.

DIR holds picture sets of rooms that no policy trains or is tested in; rooms whose seed ends a score
are held out to report on. More sets may come while it trains, from ``cfnav rooms make --views``
beside it. A killed run goes on from its checkpoint.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnx
import torch
import torch.nn.functional as F
from onnx import numpy_helper
from torch import Tensor
from tqdm import tqdm

from cfnav_core.files.checkpoint import (
    SUPERVISED,
    CheckpointError,
    load_state,
    load_tensors,
    save_state,
)
from cfnav_core.files.locks import locked
from cfnav_core.files.provenance import sha256
from cfnav_core.perception.judge import agreement, shown_in
from cfnav_core.perception.net import (
    PerceptionNet,
    export_perception,
    perception_loss,
    visible_here,
)
from cfnav_core.perception.onnx_session import open_session
from cfnav_core.perception.picture_set import PictureSet
from cfnav_core.perception.shelf import Shelf, labelled
from cfnav_core.perception.sight import Sight
from cfnav_core.perception.trunk import Trunk
from cfnav_core.task.camera import CameraSetUp
from cfnav_core.task.rooms import furniture_of

TRUNK_RATE = 0.1
"""Learning rate of the trunk, as a share: it has seen photographs, and is to remember them."""
OF_WHOLE_PICTURE = ("where", "squeeze.3.", "geometry.")
"""Layers whose size is the picture's."""
SINCE = ("place.", "scene.")
"""Layers that networks of an earlier time lack; at first they pass on what is there."""


@dataclass(frozen=True)
class PerceptionOptions:
    """Train the perception network on rendered pictures."""

    data: Path
    """Folder of picture sets (cfnav rooms make --views N)."""
    out: Path = Path("out/perception/perception.onnx")
    """Where the network goes; the checkpoint lies beside it."""
    pictures: int = 2_000_000
    """Pictures seen in all."""
    wait_for: int = 0
    """Picture sets to wait for while they are made; 0: it begins with those that are there."""
    batch: int = 32
    """Pictures a step."""
    lr: float = 1.5e-3
    """Peak learning rate of the one-cycle schedule."""
    seed: int = 0
    """Seed of weights, order and augmentation."""
    threads: int = 2
    """CPU threads that learn; one more makes the next batches meanwhile."""
    bfloat16: bool = False
    """Multiply in bfloat16: half as fast again or more where the CPU does so (AMX, AVX512-BF16),
    slower where it does not."""
    photographs: bool = True
    """Begin with first layers that learnt from photographs (perception.trunk); else with random
    ones."""
    begin: Path | None = None
    """A network to begin with, its checkpoint or its ONNX file. Layers that read the whole picture
    are stretched where it looks at another number of pixels."""
    checkpoint_s: float = 120.0
    """Seconds between checkpoints."""

    def run_command(self) -> None:
        """Train and print the report."""
        for key, value in train(self).items():
            print(f"{key}: {value}")


def begin_with(net: PerceptionNet, path: Path) -> None:
    """Take over the weights of another network wherever their shapes agree.

    Layers that read the whole picture are stretched to more or fewer cells of the same shape.

    Args:
        net: takes them.
        path: checkpoint, or what ``export_perception`` wrote.

    Raises:
        CheckpointError: it is damaged, or its layers are others.
    """
    tensors = _exported(path) if path.suffix == ".onnx" else load_tensors(path, SUPERVISED)[0]
    own = net.state_dict()
    theirs = {name: tensors[f"net.{name}"] for name in own if f"net.{name}" in tensors}
    stretched = {
        name: _stretched(theirs[name], weight, net.sight.coarse, name.startswith("squeeze."))
        for name, weight in own.items()
        if name in theirs and name.startswith(OF_WHOLE_PICTURE[1:])
    }
    theirs |= {name: weight for name, weight in stretched.items() if weight is not None}
    same = {name: of for name, of in theirs.items() if of.shape == own[name].shape}
    missing = [
        name for name in own if name not in same and not name.startswith(OF_WHOLE_PICTURE + SINCE)
        and not name.endswith("num_batches_tracked")
    ]  # fmt: skip
    if missing:
        raise CheckpointError(
            f"found no weights for {missing[0]} and {len(missing) - 1} more in {path}, expected "
            "what cfnav perception wrote, not before its networks could be trained on"
        )
    net.load_state_dict(same, strict=False)


def _stretched(weight: Tensor, own: Tensor, cells: tuple[int, int], summed: bool) -> Tensor | None:
    """A layer's weights for another number of cells, None where their shape is another.

    Args:
        weight: of the other network.
        own: that are to be replaced; they differ along the axis of the cells.
        cells: rows and columns of the own ones.
        summed: whether the layer sums over cells; else it tells of each.
    """
    sizes = enumerate(zip(weight.shape, own.shape, strict=True))
    axis = next((k for k, (a, b) in sizes if a != b), -1)
    if axis < 0:
        return weight
    kinds, (rows, columns) = own.shape[axis] // math.prod(cells), cells
    count = weight.shape[axis] // kinds
    before = round(math.sqrt(count * rows / columns))
    if before * (count // before) * kinds != weight.shape[axis]:
        return None
    last = weight.movedim(axis, -1)
    grid = last.reshape(-1, kinds, before, count // before)
    grid = F.interpolate(grid, size=cells, mode="bilinear")
    grid *= count / math.prod(cells) if summed else 1.0
    return grid.reshape(*last.shape[:-1], -1).movedim(-1, axis)


def _exported(path: Path) -> dict[str, Tensor]:
    """The weights of an ONNX file by name."""
    try:
        open_session(path)
    except ValueError as error:
        raise CheckpointError(
            f"found no readable network at {path} ({error}); name another file"
        ) from error
    weights = onnx.load(path).graph.initializer
    return {w.name: torch.from_numpy(numpy_helper.to_array(w).copy()) for w in weights}


def learning_rate(progress: float, peak: float) -> float:
    """Warm up over 3 %, hold to 40 %, then fall to 1 % along a cosine."""
    if progress < 0.03:
        return peak * (0.05 + progress / 0.03 * 0.95)
    fall = min(max((progress - 0.4) / 0.6, 0.0), 1.0)
    return peak * (0.01 + 0.99 * 0.5 * (1 + np.cos(np.pi * fall)))


def _scores(net: PerceptionNet, folders: list[Path]) -> Iterator[tuple[np.ndarray, ...]]:
    """Of each set: scores "shown" and "near" [N, C], whether they are so, and depth errors."""
    for folder in folders:
        pictures = PictureSet.load(folder)
        for index in np.array_split(
            np.arange(len(pictures.pictures)), 1 + len(pictures.pictures) // 100
        ):
            batch = labelled((pictures, index))
            shown, near, _, geometry = net(
                batch.pictures.contiguous(memory_format=torch.channels_last)
            )
            yield (
                torch.sigmoid(shown.amax((2, 3))).numpy(),
                visible_here(shown, near).amax((2, 3)).exp().numpy(),
                shown_in(pictures.heat[index]), pictures.visible[index],
                ((geometry[:, 0].exp() - batch.depth).abs() / batch.depth).mean((1, 2)).numpy(),
            )  # fmt: skip


@torch.no_grad()
def report(net: PerceptionNet, folders: list[Path]) -> dict[str, object]:
    """Quality on held-out rooms: AUC of "shown", AUC and F1 of "near", and the depth's error."""
    net.eval()
    shown, near, is_shown, is_near, depth = (
        np.concatenate(column) for column in zip(*_scores(net, folders), strict=True)
    )
    net.train()

    return {
        "rooms": len(folders), "pictures": len(depth),
        **agreement(shown, near, is_shown, is_near),
        "depth_relative_error": float(depth.mean()),
    }  # fmt: skip


def _settings(options: PerceptionOptions, camera: CameraSetUp) -> dict[str, object]:
    """What a run that goes on has to have in common with its checkpoint."""
    try:
        begin = sha256(options.begin) if options.begin else None
    except OSError as error:
        raise CheckpointError(
            f"found no readable network at {options.begin} ({error}); name another file"
        ) from error
    return {
        "camera": camera.to_json(), "begin": begin, "photographs": options.photographs,
        "seed": options.seed, "batch": options.batch, "lr": options.lr,
    }  # fmt: skip


def train(options: PerceptionOptions) -> dict[str, object]:
    """Train, export and report.

    Raises:
        ValueError: too few picture sets, a damaged one, one of a room that tests, or a checkpoint
            of a run with other settings.
        OSError: another process writes the same network.
    """
    options.out.parent.mkdir(parents=True, exist_ok=True)
    with locked(options.out.with_suffix(".lock")):
        return _train(options)


def _train(options: PerceptionOptions) -> dict[str, object]:
    torch.set_num_threads(options.threads)
    shelf = Shelf(options.data)
    shelf.wait(options.wait_for)
    camera = shelf.camera
    torch.manual_seed(options.seed)
    net = PerceptionNet(
        sight=Sight.of(camera), trunk=Trunk.from_photographs() if options.photographs else None
    )
    if options.photographs:
        net.trunk.keep_first()
    # torch does not type this form of Module.to
    net = net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    trunk = [weight for weight in net.trunk.parameters() if weight.requires_grad]
    head = [weight for name, weight in net.named_parameters() if not name.startswith("trunk.")]
    groups = [
        {"params": head, "share": 1.0},
        {"params": trunk, "share": TRUNK_RATE if options.photographs else 1.0},
    ]
    optimizer = torch.optim.AdamW(groups, options.lr, weight_decay=1e-2, fused=True)
    checkpoint, run, seen = options.out.with_suffix(".checkpoint"), _settings(options, camera), 0
    if checkpoint.exists():
        seen = load_state(checkpoint, net, optimizer, run)
    elif options.begin:
        begin_with(net, options.begin)
    bar = tqdm(total=options.pictures, initial=seen, unit="picture", mininterval=10)
    saved = time.monotonic()
    smooth: dict[str, float] = {}
    for batch in shelf.batches(seen, options.pictures, options.batch, options.seed):
        for group in optimizer.param_groups:
            group["lr"] = group["share"] * learning_rate(seen / options.pictures, options.lr)
        with torch.autocast("cpu", torch.bfloat16, enabled=options.bfloat16):
            output = net(batch.pictures.contiguous(memory_format=torch.channels_last))
        shown, near, features, geometry = (part.float() for part in output)
        terms = perception_loss((shown, near, features, geometry), batch)
        optimizer.zero_grad()
        torch.stack(list(terms.values())).sum().backward()
        optimizer.step()
        seen += options.batch
        bar.update(options.batch)
        for key, value in terms.items():
            smooth[key] = 0.98 * smooth.get(key, value.item()) + 0.02 * value.item()
        if time.monotonic() - saved > options.checkpoint_s or seen >= options.pictures:
            terms_now = " ".join(f"{k} {v:.3f}" for k, v in smooth.items())
            bar.set_postfix_str(f"{len(shelf.training)} rooms {terms_now}")
            save_state(checkpoint, net, optimizer, seen, run)
            saved = time.monotonic()
    bar.close()
    export_perception(net, options.out, camera=camera)
    by_furniture: dict[str, list[Path]] = {}
    for folder in shelf.held_out:
        kind = folder.name.rpartition("_")[0]
        by_furniture.setdefault(furniture_of(kind), []).append(folder)
    reports = {f"held out, {name}": report(net, found) for name, found in by_furniture.items()}
    return {"training_rooms": len(shelf.training), "seen": seen, **reports}
