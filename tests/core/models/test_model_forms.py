"""Parts written for speed answer and learn as their formulas written plainly."""

from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor, nn
from torch.nn.functional import one_hot

from cfnav_core.models.mjolnir import ObjectGraph
from cfnav_core.models.parts.graphs import normalised
from cfnav_core.models.parts.layout import attention
from cfnav_core.models.parts.reading import Rows, columns_of, similarities
from cfnav_core.models.parts.relation import RelationEncoder
from cfnav_core.models.tdanet import TargetAttention
from cfnav_core.task.detections import SCORES

B, C = 3, 7


def plain_relation(m: RelationEncoder, rows: Rows, goal: Tensor, codes: Tensor, weight) -> Tensor:
    relation = torch.relu(m.first(torch.cat([rows.info, goal[:, :, None]], 2))).transpose(1, 2)
    for layer in m.mix:
        relation = torch.relu(layer(relation))
    appearance = relation.transpose(1, 2) @ rows.appearance
    row = torch.cat([appearance, rows.info, goal[:, :, None] * codes], 2) * weight[:, :, None]
    return m.map(torch.relu(m.row(row))).unflatten(2, (m.side, m.side))


def plain_graph(m: ObjectGraph, context: Tensor) -> Tensor:
    there = context[:, None, :, 0].expand(-1, C, -1)
    x = torch.cat([there, m.words.expand(len(context), -1, -1)], 2)
    for layer in (m.first, m.second, m.third):
        x = torch.relu(m.adjacency @ layer(x))
    x = torch.relu(m.adjacency @ m.last(torch.cat([x, context], 2)))
    return m.out(x[:, :, 0])


def gradients(module: nn.Module, out: Tensor) -> dict[str, Tensor]:
    """Of something to which every number of the answer adds."""
    module.zero_grad()
    (out * torch.linspace(1, 2, out.numel()).view_as(out)).sum().backward()
    return {k: p.grad.clone() for k, p in module.named_parameters() if p.grad is not None}


def assert_alike(module: nn.Module, found: Tensor, expected: Tensor) -> None:
    torch.testing.assert_close(found, expected)
    learnt, known = gradients(module, found), gradients(module, expected)
    assert learnt.keys() == known.keys()
    for name, gradient in known.items():
        torch.testing.assert_close(learnt[name], gradient, rtol=1e-5, atol=1e-5, msg=name)


def some_goals() -> Tensor:
    return one_hot(torch.tensor([2, 0, C - 1]), C).float()


@pytest.mark.parametrize("width", [1, 4])
def test_relation_encoder(width):
    torch.manual_seed(0)
    m = RelationEncoder(C, 5, 5, width, 3, mixes=2)
    rows, goal, codes = (
        columns_of(SCORES).read(torch.rand(B, C, 5)),
        some_goals(),
        torch.rand(C, width),
    )
    weight = torch.rand(B, C)
    found = m(rows, goal, codes, weight)
    assert_alike(m, found, plain_relation(m, rows, goal, codes, weight))
    one = torch.ones(B, C)
    assert_alike(m, m(rows, goal, codes), plain_relation(m, rows, goal, codes, one))


def test_object_graph():
    torch.manual_seed(0)
    adjacency = normalised((torch.rand(C, C) < 0.5).float())
    m, context = ObjectGraph(adjacency, torch.randn(C, 4), 6, 8), torch.rand(B, C, 6)
    assert_alike(m, m(context), plain_graph(m, context))


def test_a_view_of_nothing_but_the_goal():
    torch.manual_seed(0)
    m, words, goal, found = TargetAttention(4, 5), torch.randn(C, 4), some_goals(), torch.rand(5)
    alike = goal @ similarities(words)
    whole = m(goal[:, :, None] * found, goal, goal, words, alike)
    own = (goal * alike).sum(1, keepdim=True)
    alone = m.of_goal(found.expand(B, -1), own)
    torch.testing.assert_close(alone, whole)
    learnt = gradients(m, alone)
    for name, gradient in gradients(m, whole).items():
        torch.testing.assert_close(learnt.get(name, torch.zeros(())).expand_as(gradient), gradient)


def test_target_attention():
    torch.manual_seed(0)
    m, words, goal = TargetAttention(4, 5), torch.randn(C, 4), some_goals()
    context, there, alike = torch.rand(B, C, 5), (torch.rand(B, C) < 0.6).float(), torch.rand(B, C)
    own = (context * goal[:, :, None]).sum(1)
    pair = torch.cat([context, own[:, None].expand_as(context)], 2)
    score = m.query(goal @ words) @ m.key(words).T / m.key.out_features**0.5
    score = (score + m.place(pair)[:, :, 0]).masked_fill(there == 0, -torch.inf)
    value = m.value(torch.cat([context, alike[:, :, None]], 2))
    seen = (F.softmax(score, 1)[:, :, None] * value).sum(1)
    assert_alike(m, m(context, there, goal, words, alike), torch.cat([seen, own], 1))


def test_layout_attention():
    torch.manual_seed(0)
    prior, added, goal = torch.rand(B, C, C), torch.rand(B, C), some_goals()
    counts = prior + added[:, None]
    shares = counts / counts.sum(2, keepdim=True) + torch.eye(C)
    expected = (shares * goal[:, None]).sum(2)
    torch.testing.assert_close(attention(prior, added, goal), expected)
