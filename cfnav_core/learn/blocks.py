"""Rows of large arrays, joined in the memory of a device or read from disk as they are needed."""

from __future__ import annotations

import mmap
from typing import Any

import numpy as np
import torch
from torch import Tensor

IN_MEMORY_BYTES = 2 << 30
"""Features and detections up to this size each are joined in main memory."""


class Blocks:
    """Rows of equal shape in one or many arrays, read by row number.

    What fits is joined in the memory of the device, at most half of a GPU's. Larger data stay
    mapped from disk: a row in use is read from there, and the process itself holds nothing of it;
    the system keeps read pages as long as it has memory to spare.

    Args:
        arrays: float16 [n_k, ...] each.
        device: where rows are wanted.
        in_memory: whether they may be joined.
    """

    def __init__(
        self, arrays: list[np.ndarray], device: torch.device, in_memory: bool = True
    ) -> None:
        self.device = device
        most = IN_MEMORY_BYTES
        if device.type == "cuda":
            most = torch.cuda.mem_get_info(device)[0] // 2
        self._joined = in_memory and sum(a.nbytes for a in arrays) <= most
        self._blocks = [torch.from_numpy(a) for a in arrays]
        ends = np.cumsum([len(a) for a in arrays])
        self._first = torch.from_numpy(np.append(0, ends[:-1]))
        if self._joined:
            self._blocks = [self._join(int(ends[-1]))]
        else:
            for array in arrays:
                _read_only_what_is_asked_for(array)

    def _join(self, rows: int) -> Tensor:
        shape, kind = (rows, *self._blocks[0].shape[1:]), self._blocks[0].dtype
        # 1x1 convolutions read the channels of a place; the values stay the same
        order = torch.channels_last if len(shape) == 4 else torch.contiguous_format
        whole = torch.empty(shape, dtype=kind, device=self.device, memory_format=order)
        for first, block in zip(self._first.tolist(), self._blocks, strict=True):
            whole[first : first + len(block)] = block.to(self.device)
        return whole

    def __getitem__(self, rows: Tensor) -> Tensor:
        """Float32 [..., *shape] on the device, of rows int64 [...]."""
        if self._joined:
            return self._blocks[0][rows.to(self.device)].float()
        flat = rows.flatten().cpu()
        block = torch.searchsorted(self._first, flat, right=True) - 1
        out = torch.empty(len(flat), *self._blocks[0].shape[1:], device="cpu")
        for k in block.unique().tolist():
            at = (block == k).nonzero()[:, 0]
            out[at] = self._blocks[k][flat[at] - self._first[k]].float()
        return out.unflatten(0, rows.shape).to(self.device)


def _read_only_what_is_asked_for(array: np.ndarray) -> None:
    """Tell the system not to read ahead in a mapped file: rows are drawn at random."""
    base: Any = array
    while isinstance(base, np.ndarray):
        base = base.base
    if isinstance(base, mmap.mmap):
        base.madvise(mmap.MADV_RANDOM)
