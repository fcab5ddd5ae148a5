"""Pictures as other cameras would have taken them, for training perception.

What a lens, a sensor and a driver do to a picture, drawn for each anew: a tilted and bent view,
blur, light and white balance, a tone curve, vignetting, noise, JPEG, and what stands before the
lens. The strengths reach beyond those of a good camera in a lit room, so that what a network learns
does not hang on any of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

ROLL_RAD, SHIFT, BEND = 0.05, 0.04, 0.08
"""Standard deviations: turn about the axis, shift as share of the half picture, radial distortion.
No zoom: it would make things seem nearer than their labels say."""
BLURRED, LARGEST_BLUR_PX = 0.5, 1.6
"""Share of blurred pictures, and the largest standard deviation."""
NOISE = 0.06
"""Largest standard deviation of the sensor's noise, of full scale."""
VIGNETTE = 0.5
"""Largest share of light that the corners lose."""
JPEG, WORST_QUALITY, BEST_QUALITY = 0.4, 25, 90
"""Share of pictures that go through JPEG, and its qualities."""
COVERED = 0.15
"""Share of pictures with something of one colour before the lens."""


@dataclass(frozen=True)
class Labelled:
    """Pictures and labels on their way into a network.

    Attributes:
        pictures: float32 [N, 3, *P] in 0..1; P, Q, R see ``sight.Sight``.
        heat: float32 [N, C, *Q], pixels of each category per cell.
        near: float32 [N, C, *Q], those of visible things.
        depth: float32 [N, *R], metres.
        floor: float32 [N, *R], share 0..1.
    """

    pictures: Tensor
    heat: Tensor
    near: Tensor
    depth: Tensor
    floor: Tensor

    @property
    def visible(self) -> Tensor:
        """float32 [N, C]: which categories are visible."""
        return (self.near.amax((2, 3)) > 0).float()


def augment(batch: Labelled, generator: torch.Generator) -> Labelled:
    """The same views through other lenses, by other light.

    Args:
        batch: of rendered pictures.
        generator: draws everything, so that a batch can be made again.
    """
    batch = _mirrored(_moved(batch, generator), generator)
    pictures = batch.pictures
    for change in (_blurred, _lit, _vignetted, _covered, _noisy, _packed):
        pictures = change(pictures, generator)
    return replace(batch, pictures=pictures)


def _uniform(n: int, low: float, high: float, generator: torch.Generator) -> Tensor:
    """float32 [n, 1, 1, 1]."""
    return torch.rand(n, 1, 1, 1, generator=generator) * (high - low) + low


def _chosen(n: int, share: float, generator: torch.Generator) -> Tensor:
    """Bool [n]."""
    return torch.rand(n, generator=generator) < share


def _moved(batch: Labelled, generator: torch.Generator) -> Labelled:
    """Roll, shift and distort pictures, and their maps alike."""
    n, _, height, width = batch.pictures.shape
    roll, across, down, bend = torch.randn(4, n, 1, 1, generator=generator)
    aspect = width / height
    maps = (torch.cat([batch.heat, batch.near], 1), batch.depth[:, None], batch.floor[:, None])

    def grid(rows: int, columns: int) -> Tensor:
        y, x = torch.meshgrid(
            torch.linspace(-1, 1, rows), torch.linspace(-1, 1, columns), indexing="ij"
        )
        x, y = x * aspect, y  # so that a turn keeps right angles
        c, s = torch.cos(ROLL_RAD * roll), torch.sin(ROLL_RAD * roll)
        stretch = 1 + BEND * bend * ((x * x + y * y) / (1 + aspect**2) - 0.5)
        u, v = stretch * (c * x - s * y) / aspect, stretch * (s * x + c * y)
        return torch.stack([u + SHIFT * across, v + SHIFT * down], dim=-1)

    pictures = F.grid_sample(
        batch.pictures, grid(height, width), padding_mode="reflection", align_corners=True
    )
    pixels, depth, floor = (
        F.grid_sample(m, grid(*m.shape[2:]), padding_mode=padding, align_corners=True)
        for m, padding in zip(maps, ("zeros", "border", "border"), strict=True)
    )
    heat, near = pixels.chunk(2, 1)
    return Labelled(pictures, heat, near, depth[:, 0], floor[:, 0])


def _mirrored(batch: Labelled, generator: torch.Generator) -> Labelled:
    flip = _chosen(len(batch.pictures), 0.5, generator)

    def some(values: Tensor) -> Tensor:
        return torch.where(flip.view(-1, *[1] * (values.dim() - 1)), values.flip(-1), values)

    return Labelled(
        some(batch.pictures), some(batch.heat), some(batch.near),
        some(batch.depth), some(batch.floor),
    )  # fmt: skip


def _blurred(pictures: Tensor, generator: torch.Generator) -> Tensor:
    """Out of focus, or moving: some through a Gaussian of their own."""
    sigmas = 0.2 + LARGEST_BLUR_PX * torch.rand(len(pictures), generator=generator)
    which = torch.nonzero(_chosen(len(pictures), BLURRED, generator)).flatten().tolist()
    pictures = pictures.clone()
    for k in which:
        sharp = np.ascontiguousarray(pictures[k].permute(1, 2, 0).numpy())
        soft = cv2.GaussianBlur(sharp, (0, 0), float(sigmas[k]))
        pictures[k] = torch.from_numpy(soft).permute(2, 0, 1)
    return pictures


def _lit(pictures: Tensor, generator: torch.Generator) -> Tensor:
    """Exposure, white balance, colours that mix, contrast and a tone curve."""
    n = len(pictures)
    mix = torch.eye(3) + 0.1 * torch.randn(n, 3, 3, generator=generator)
    exposure = torch.exp(0.35 * torch.randn(n, 1, 1, generator=generator))
    warmth = 0.15 * torch.randn(n, 1, generator=generator)
    balance = torch.exp(torch.cat([warmth, torch.zeros_like(warmth), -warmth], 1))[..., None]
    mix = mix * exposure * balance
    share = torch.rand(n, 1, 1, generator=generator)
    lift = 0.1 * (2 * torch.rand(n, 1, 1, generator=generator) - 1)
    shift = 0.4 * (1 - mix.sum(2, keepdim=True)) * share + lift
    flat = torch.baddbmm(shift, mix, pictures.flatten(2)).clamp_(0, 1)
    curve = 0.8 * torch.rand(n, 1, 1, generator=generator) - 0.4
    return (flat * (1 + curve) - curve * flat * flat).view_as(pictures)


def _vignetted(pictures: Tensor, generator: torch.Generator) -> Tensor:
    n, _, height, width = pictures.shape
    y, x = torch.linspace(-1, 1, height)[:, None], torch.linspace(-1, 1, width)
    lost = _uniform(n, 0.0, VIGNETTE, generator) * (
        torch.rand(n, 1, 1, 1, generator=generator) < 0.5
    )
    return pictures * (1 - lost * (x * x + y * y) / 2)


def _covered(pictures: Tensor, generator: torch.Generator) -> Tensor:
    """A hand, a cable or a post before the lens, which hides a part and changes no label."""
    n, _, height, width = pictures.shape
    pictures = pictures.clone()
    for k in torch.nonzero(_chosen(n, COVERED, generator)).flatten().tolist():
        at = torch.rand(4, generator=generator)
        h, w = (
            int(side * (0.04 + 0.14 * float(s)))
            for side, s in zip((height, width), at[:2], strict=True)
        )
        top, left = int(float(at[2]) * (height - h)), int(float(at[3]) * (width - w))
        colour = torch.rand(3, 1, 1, generator=generator)
        pictures[k, :, top : top + h, left : left + w] = colour
    return pictures


def _noisy(pictures: Tensor, generator: torch.Generator) -> Tensor:
    """More where it is dark, as sensors turn up their gain."""
    strength = _uniform(len(pictures), 0.0, 1.0, generator) ** 2 * NOISE
    noise = torch.randn(pictures.shape, generator=generator)
    return (pictures + strength * noise * (1.25 - 0.5 * pictures)).clamp_(0, 1)


def _packed(pictures: Tensor, generator: torch.Generator) -> Tensor:
    """Some through JPEG, all rounded to the levels of bytes."""
    levels = (pictures * 255).round().to(torch.uint8)
    for k in torch.nonzero(_chosen(len(levels), JPEG, generator)).flatten().tolist():
        quality = int(torch.randint(WORST_QUALITY, BEST_QUALITY, (1,), generator=generator))
        rgb = np.ascontiguousarray(levels[k].permute(1, 2, 0).numpy())
        _, packed = cv2.imencode(".jpg", rgb, [cv2.IMWRITE_JPEG_QUALITY, quality])
        again = np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR))
        levels[k] = torch.from_numpy(again).permute(2, 0, 1)
    return levels.float() / 255
