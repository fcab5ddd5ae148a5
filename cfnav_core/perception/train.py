"""Train perception: ``cfnav perception --data DIR --out perception.onnx``.

DIR holds picture sets of rooms that no policy trains or is tested in. The last twentieth of the
rooms is held out to report on. A killed run goes on from its checkpoint.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from scipy.stats import rankdata
from torch import Tensor
from tqdm import tqdm

from cfnav_core.files.checkpoint import load_state, save_state
from cfnav_core.perception.net import PerceptionNet, export_perception, perception_loss
from cfnav_core.perception.picture_set import FIELDS, PictureSet
from cfnav_core.task.vocabulary import CATEGORIES


@dataclass(frozen=True)
class PerceptionOptions:
    """Train the perception network on rendered pictures."""

    data: Path
    """Folder of picture sets (cfnav rooms make --views N)."""
    out: Path = Path("out/perception/perception.onnx")
    """Where the network goes; the checkpoint lies beside it."""
    pictures: int = 500_000
    """Pictures seen in all."""
    batch: int = 64
    """Pictures a step."""
    lr: float = 2e-3
    """Peak learning rate of the one-cycle schedule."""
    seed: int = 0
    """Seed of weights, order and augmentation."""
    threads: int = 2
    """CPU threads."""
    checkpoint_s: float = 120.0
    """Seconds between checkpoints."""

    def run_command(self) -> None:
        """Train and print the report."""
        for key, value in train(self).items():
            print(f"{key}: {value}")


class Pictures:
    """All picture sets of some rooms in memory."""

    def __init__(self, folders: list[Path]) -> None:
        sets = [PictureSet.load(f) for f in folders]
        self.arrays = {k: np.concatenate([getattr(s, k) for s in sets]) for k in FIELDS}
        self.count = len(self.arrays["visible"])

    def batch(self, index: np.ndarray) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        """Pictures float32 [N, 3, 150, 150] in 0..1, and what ``perception_loss`` takes."""
        a = {k: torch.from_numpy(v[index]) for k, v in self.arrays.items()}
        pictures = a["pictures"].permute(0, 3, 1, 2).float().div_(255)
        heat = a["heat"].permute(0, 3, 1, 2).float()
        return pictures, heat, a["depth"].float(), a["floor"].float() / 255, a["visible"].float()


def augment(pictures: Tensor, generator: torch.Generator) -> Tensor:
    """Random colour mixing, brightness, contrast and gamma-like curve, per picture."""
    n = len(pictures)

    def uniform(low: float, high: float) -> Tensor:
        return torch.rand(n, 1, 1, generator=generator) * (high - low) + low

    mix = torch.eye(3) + 0.1 * torch.randn(n, 3, 3, generator=generator)
    mix = mix * uniform(0.7, 1.35)
    shift = 0.4 * (1 - mix.sum(2, keepdim=True)) * uniform(0, 1) + uniform(-0.1, 0.1)
    flat = torch.baddbmm(shift, mix, pictures.flatten(2)).clamp_(0, 1)
    curve = uniform(-0.4, 0.4)
    return (flat * (1 + curve) - curve * flat * flat).view_as(pictures)


def learning_rate(progress: float, peak: float) -> float:
    """Warm up over 3 %, hold to 40 %, then fall to 1 % along a cosine."""
    if progress < 0.03:
        return peak * (0.05 + progress / 0.03 * 0.95)
    fall = min(max((progress - 0.4) / 0.6, 0.0), 1.0)
    return peak * (0.01 + 0.99 * 0.5 * (1 + np.cos(np.pi * fall)))


def area_under_roc(score: np.ndarray, label: np.ndarray) -> float:
    """Chance that a positive scores above a negative, ties half; both must be present."""
    positives = int(label.sum())
    ranks = rankdata(score)[label].sum() - positives * (positives + 1) / 2
    return float(ranks / (positives * (len(label) - positives)))


@torch.no_grad()
def report(net: PerceptionNet, pictures: Pictures) -> dict[str, object]:
    """Quality on held-out rooms: AUC and F1 of "visible" per category, depth and floor errors."""
    net.eval()
    near, truth, depth_error = [], [], []
    for index in np.array_split(np.arange(pictures.count), max(1, pictures.count // 100)):
        x, _, depth, _, visible = pictures.batch(index)
        _, here, _, geometry = net(x.contiguous(memory_format=torch.channels_last))
        near.append(torch.sigmoid(here.amax((2, 3))))
        truth.append(visible.bool())
        depth_error.append((geometry[:, 0].exp() - depth).abs() / depth)
    net.train()
    p, y = torch.cat(near).numpy(), torch.cat(truth).numpy()
    enough = [c for c in range(len(CATEGORIES)) if 10 <= y[:, c].sum() < len(y)]

    def f1(c: int | slice) -> float:
        hit = p[:, c] > 0.5
        return float(2 * (hit & y[:, c]).sum() / max(1, hit.sum() + y[:, c].sum()))

    return {
        "pictures": len(y),
        "visible_auc_mean": float(np.mean([area_under_roc(p[:, c], y[:, c]) for c in enough])),
        "visible_f1": f1(slice(None)),
        "visible_f1_by_category": {CATEGORIES[c]: round(f1(c), 3) for c in enough},
        "depth_relative_error": float(torch.cat(depth_error).mean()),
    }


def train(options: PerceptionOptions) -> dict[str, object]:
    """Train, export and report.

    Raises:
        ValueError: no picture sets, or a damaged one.
    """
    torch.set_num_threads(options.threads)
    folders = sorted(p.parent for p in options.data.glob("*/set.json"))
    if len(folders) < 4:
        raise ValueError(
            f"found {len(folders)} picture sets in {options.data}, expected at least 4; make them "
            "with cfnav rooms make --views 40"
        )
    order = np.random.default_rng(0).permutation(len(folders))
    held = max(1, len(folders) // 20)
    training = Pictures([folders[i] for i in order[held:]])
    held_out = Pictures([folders[i] for i in order[:held]])
    torch.manual_seed(options.seed)
    net = PerceptionNet()
    # torch does not type this form of Module.to
    net = net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    optimizer = torch.optim.AdamW(net.parameters(), options.lr, weight_decay=1e-2, fused=True)
    checkpoint = options.out.with_suffix(".checkpoint")
    seen = load_state(checkpoint, net, optimizer) if checkpoint.exists() else 0
    bar = tqdm(total=options.pictures, initial=seen, unit="picture", mininterval=10)
    saved = time.monotonic()
    smooth: dict[str, float] = {}
    while seen < options.pictures:
        rng = np.random.default_rng([options.seed, seen])
        generator = torch.Generator().manual_seed(options.seed * 1_000_003 + seen)
        x, *labels = training.batch(np.sort(rng.integers(training.count, size=options.batch)))
        x = augment(x, generator)
        if rng.random() < 0.5:
            x, labels[0], labels[1], labels[2] = (t.flip(-1) for t in (x, *labels[:3]))
        for group in optimizer.param_groups:
            group["lr"] = learning_rate(seen / options.pictures, options.lr)
        terms = perception_loss(net(x.contiguous(memory_format=torch.channels_last)), *labels)
        optimizer.zero_grad()
        torch.stack(list(terms.values())).sum().backward()
        optimizer.step()
        seen += options.batch
        bar.update(options.batch)
        for key, value in terms.items():
            smooth[key] = 0.98 * smooth.get(key, value.item()) + 0.02 * value.item()
        if time.monotonic() - saved > options.checkpoint_s or seen >= options.pictures:
            bar.set_postfix_str(" ".join(f"{k} {v:.3f}" for k, v in smooth.items()))
            save_state(checkpoint, net, optimizer, seen)
            saved = time.monotonic()
    bar.close()
    export_perception(net, options.out)
    return {"training_pictures": training.count, "seen": seen, **report(net, held_out)}
