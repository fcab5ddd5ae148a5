"""Graphs of zones and objects: normalised adjacency, first hops, and where one is among zones."""

from __future__ import annotations

import torch
from torch import Tensor


def normalised(adjacency: Tensor) -> Tensor:
    """D^-1/2 A^T D^-1/2 with D from the row sums of A; rows without an edge give zeros.

    Args:
        adjacency: float32 [..., N, N], not negative.

    Returns:
        The same shape.
    """
    degree = adjacency.sum(-1)
    scale = torch.where(degree > 0, degree, torch.inf).rsqrt()
    return scale[..., :, None] * adjacency.transpose(-1, -2) * scale[..., None, :]


def edge_lengths(edges: Tensor) -> Tensor:
    """-log of the edges, scaled so that the strongest is 0 long and the weakest 1.

    Args:
        edges: float32 [Z, Z] in 0..1; the diagonal is ignored.

    Returns:
        Float64 [Z, Z]; 0 on the diagonal, inf where there is no edge.
    """
    length = -edges.double().log()
    here = torch.eye(len(edges), dtype=torch.bool)
    there = length[~here & length.isfinite()]
    if len(there) and there.max() > there.min():
        length = (length - there.min()) / (there.max() - there.min())
    elif len(there):
        length = length - there.min()
    return length.masked_fill(here, 0)


def first_hops(edges: Tensor) -> Tensor:
    """The first zone on the shortest way from each zone to each other.

    The published Dijkstra routine writes what it finds back into the lengths, so that its answers
    drift over a run; here the lengths stay.

    Args:
        edges: float32 [Z, Z], see ``edge_lengths``.

    Returns:
        int64 [Z, Z], from row to column; a zone itself on the diagonal, the last zone itself where
        no way leads to it.
    """
    length = edge_lengths(edges)
    hop = torch.arange(len(edges)).repeat(len(edges), 1)
    for k in range(len(edges)):
        through = length[:, k, None] + length[k]
        shorter = through < length
        hop = torch.where(shorter, hop[:, k, None], hop)
        length = torch.where(shorter, through, length)
    return hop


def nearest_zone(detected: Tensor, nodes: Tensor) -> Tensor:
    """The zone whose node is nearest to what is seen.

    Args:
        detected: float32 [B, C], 0 or 1.
        nodes: float32 [B, Z, C].

    Returns:
        int64 [B].
    """
    # as PyTorch's pairwise distance, which the published code calls
    return (detected[:, None] - nodes + 1e-6).norm(dim=2).argmin(1)


def zone_change(detected: Tensor, nodes: Tensor, zone: Tensor, rate: Tensor) -> Tensor:
    """How the present zone's node moves towards what is seen.

    Args:
        detected: float32 [B, C], 0 or 1.
        nodes: float32 [B, Z, C].
        zone: int64 [B].
        rate: float32 [], share of the way.

    Returns:
        Float32 [B, Z, C], zero for the other zones.
    """
    here = torch.nn.functional.one_hot(zone, nodes.shape[1])[:, :, None]
    return rate * here * (detected[:, None] - nodes)


def lookup(table: Tensor, *index: Tensor) -> Tensor:
    """``table[index]`` by one flat index, which exports to ONNX as one plain operator.

    Args:
        table: as many axes as there are indices, or more.
        index: int64 [B] each, not negative.
    """
    flat, *others = index
    for i, length in zip(others, table.shape[1:], strict=False):
        flat = flat * length + i
    return table.flatten(0, len(index) - 1)[flat]


def goal_zone(nodes: Tensor, goal: Tensor) -> Tensor:
    """The zone, int64 [B], whose views show the goal [B, C] most often."""
    return (nodes * goal[:, None]).sum(2).argmax(1)
