"""One run on several processes (``torchrun``): each runs its part of the episodes.

All ranks hold the same weights and draw the same random numbers; they take their own rows of them,
sum what they count and average their gradients. So N ranks do what one rank with all the episodes
does, up to the rounding of sums, and to dropout and other noise inside networks, of which every
rank draws its own.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass

import torch
import torch.distributed as dist

# Loaded before there is a group, not only with the first optimizer: its functions take the group
# there is as a default, and so keep it. A group that is kept goes on with its threads, which may
# abort the process while Python ends (pytorch #179291).
import torch.distributed.nn
from torch import Tensor

from cfnav_core.learn.env import EpisodeSlice


@dataclass(frozen=True)
class Ranks:
    """This process among those of the run.

    Attributes:
        rank: 0 saves, validates and logs.
        size: number of processes.
    """

    rank: int = 0
    size: int = 1

    @classmethod
    def join(cls) -> Ranks:
        """Meet the other processes when ``torchrun`` started this one; alone otherwise."""
        if not dist.is_torchelastic_launched():
            return cls()
        if not dist.is_initialized():
            # numbers in main memory go over gloo, gradients on GPUs over NCCL
            dist.init_process_group("cpu:gloo,cuda:nccl" if torch.cuda.is_available() else "gloo")
        return cls(dist.get_rank(), dist.get_world_size())

    def device(self, name: str) -> torch.device:
        """The device that ``auto``, ``cpu`` or ``cuda`` means for this process.

        Raises:
            ValueError: there is no such device.
        """
        if name not in ("auto", "cpu", "cuda"):
            raise ValueError(f"found --device {name}, expected auto, cpu or cuda")
        if name == "cuda" and not torch.cuda.is_available():
            raise ValueError("found no GPU that torch can use; leave out --device or give cpu")
        if name == "cpu" or not torch.cuda.is_available():
            return torch.device("cpu")
        local, there = int(os.environ.get("LOCAL_RANK", 0)), torch.cuda.device_count()
        if local >= there:
            raise ValueError(
                f"found {there} GPUs, expected one for each process; give --nproc-per-node {there}"
            )
        device = torch.device("cuda", local)
        torch.cuda.set_device(device)
        return device

    @property
    def leads(self) -> bool:
        """Whether this one speaks for all."""
        return self.rank == 0

    def part(self, batch: int) -> EpisodeSlice:
        """One's share of ``batch`` parallel episodes.

        Raises:
            ValueError: they cannot be shared evenly.
        """
        if batch % self.size:
            raise ValueError(
                f"found {batch} parallel episodes for {self.size} processes, expected a multiple; "
                "change --batch or --nproc-per-node"
            )
        own = batch // self.size
        return EpisodeSlice(self.rank * own, own, batch)

    def total(self, *counts: float) -> list[float]:
        """Sum numbers over all processes."""
        if self.size == 1:
            return list(counts)
        sums = torch.tensor(counts, dtype=torch.float64)
        dist.all_reduce(sums)
        return sums.tolist()

    def joined(self, own: Tensor) -> Tensor:
        """The rows of all processes, of as many each, in their order; on the CPU."""
        own = own.detach().cpu().contiguous()
        if self.size == 1:
            return own
        parts = [torch.empty_like(own) for _ in range(self.size)]
        dist.all_gather(parts, own)
        return torch.cat(parts)

    def average(self, parameters: Iterable[Tensor]) -> None:
        """Average gradients over all processes."""
        if self.size == 1:
            return
        gradients = [p.grad for p in parameters if p.grad is not None]
        # all under way at once, without a copy of them
        for work in [dist.all_reduce(g, async_op=True) for g in gradients]:
            work.wait()
        for gradient in gradients:
            gradient /= self.size

    def leave(self) -> None:
        """Wait until everybody is here, and part."""
        if self.size > 1:
            dist.barrier()
            dist.destroy_process_group()
