"""The parts of the published models against numbers worked out by hand or step by step."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest
import torch
from torch.distributions import Dirichlet, kl_divergence

from cfnav_core.models.mjolnir import ObjectGraph
from cfnav_core.models.parts import layout
from cfnav_core.models.parts.graphs import (
    edge_lengths,
    first_hops,
    goal_zone,
    nearest_zone,
    normalised,
    zone_change,
)
from cfnav_core.models.parts.heads import gate_done
from cfnav_core.models.parts.reading import Rows, columns_of
from cfnav_core.models.parts.relation import RelationEncoder
from cfnav_core.models.table import MODELS
from cfnav_core.task.detections import SIGHTINGS, fields_before_names
from tests.core.model_samples import BUILT_IN, SMALL, knowledge, rows_of, views


def read_rows(detections: torch.Tensor) -> Rows:
    return columns_of(fields_before_names(detections.shape[2])).read(detections)


def t(*rows) -> torch.Tensor:
    return torch.tensor(rows, dtype=torch.float32)


def test_reading_pixel_boxes():
    detections = torch.zeros(1, 2, 517)
    detections[0, 0, :512] = 7
    detections[0, 0, 512:] = t(30, 60, 90, 120, 0.8)
    rows = read_rows(detections)
    assert rows.appearance.shape == (1, 2, 512)
    torch.testing.assert_close(rows.info[0], t([30, 60, 90, 120, 0.8], [0] * 5))
    torch.testing.assert_close(rows.confidence, t([0.8, 0]))
    torch.testing.assert_close(rows.detected, t([1, 0]))
    torch.testing.assert_close(rows.context[0], t([1, 0.2, 0.3, 0.04], [0] * 4))


def test_reading_the_built_in_table():
    # score 0.8 at x 0.5 and y -1; the second is not believed
    rows = read_rows(t([[0.8, 0.4, -0.8, 0.3, 0.6], [0.1, 0, 0, 0, 0]]))
    torch.testing.assert_close(rows.detected, t([1, 0]))
    expected = t([0.8, 0.6, 0, 0.09, 0.6], [0.1, 0.05, 0.05, 0, 0])
    torch.testing.assert_close(rows.context[0], expected)


def test_reading_sightings():
    # 45 degrees to the right, 22.5 up, 22.5 by 10, 1.5 m away; of the second none knows how far
    quarter, angle = math.pi / 8, math.radians(10)
    table = t(
        [0.7, 2 * quarter, quarter, quarter, angle, 1.5], [0.4, 0, 0, angle, angle, 0], [0] * 6
    )
    rows = columns_of(SIGHTINGS).read(table[None])
    torch.testing.assert_close(rows.detected, t([1, 1, 0]))
    expected = t(
        [0.7, 1.0, 0.25, 0.5, 1 / 3, math.exp(-1), 1.0],
        [0.4, 0.5, 0.5, 1 / 3, 1 / 3, 0, 0],
        [0] * 7,
    )
    torch.testing.assert_close(rows.context[0], expected)


def test_reading_visible_boxes():
    table = t([[1, 0.2, 0.3, 0.04], [0, 0, 0, 0]])
    rows = read_rows(table)
    torch.testing.assert_close(rows.context, table)
    torch.testing.assert_close(rows.detected, t([1, 0]))


def test_normalised_adjacency():
    # one directed edge 0 -> 1 of the two of row 0; row 2 has none and gives zeros
    a = t([0, 1, 1], [0, 0, 1], [0, 0, 0])
    torch.testing.assert_close(normalised(a), t([0, 0, 0], [1 / math.sqrt(2), 0, 0], [0, 0, 0]))


def test_edge_lengths():
    e = math.exp
    edges = t([1, e(-1), e(-5)], [e(-2), 1, 0], [e(-3), e(-4), 1])
    expected = torch.tensor([[0, 0, 1], [0.25, 0, torch.inf], [0.5, 0.75, 0]]).double()
    torch.testing.assert_close(edge_lengths(edges), expected)


def test_first_hop_takes_the_detour_over_strong_edges():
    e = math.exp
    edges = t([1, e(-1), e(-5)], [e(-1), 1, e(-2)], [e(-5), e(-2), 1])
    assert first_hops(edges).tolist() == [[0, 1, 1], [0, 1, 2], [1, 1, 2]]


def test_first_hop_without_a_way_is_the_goal():
    assert first_hops(t([1, 0.1, 0], [0.2, 1, 0], [0, 0, 1])).tolist() == [[0, 1, 2]] * 3


@pytest.mark.parametrize("seed", range(5))
def test_first_hops_against_all_ways(seed):
    edges = 0.05 + 0.9 * torch.rand(5, 5, generator=torch.Generator().manual_seed(seed))
    length, hops = edge_lengths(edges), first_hops(edges)
    for a, b in itertools.permutations(range(5), 2):
        others = [k for k in range(5) if k not in (a, b)]
        ways = [(a, *between, b) for n in range(4) for between in itertools.permutations(others, n)]
        cost = {w: sum(float(length[i, j]) for i, j in itertools.pairwise(w)) for w in ways}
        assert hops[a, b] == min(ways, key=cost.__getitem__)[1]


def test_zones():
    nodes = t([[1, 0, 0], [0, 1, 1]], [[0, 0, 0.4], [0, 0.6, 0.6]])
    detected = t([0, 1, 0], [0, 0, 0])
    here = nearest_zone(detected, nodes)
    assert here.tolist() == [1, 0]
    change = zone_change(detected, nodes, here, torch.tensor(0.005))
    expected = t([[0, 0, 0], [0, 0, -0.005]], [[0, 0, -0.002], [0, 0, 0]])
    torch.testing.assert_close(change, expected)
    assert goal_zone(nodes, t([1, 0, 0], [0, 0, 1])).tolist() == [0, 1]


def test_hoz_updates_the_predicted_room_and_reads_the_next_zone():
    known = knowledge(38)
    hoz = MODELS["hoz"](BUILT_IN, SMALL, known).eval()
    hoz.room.room.weight.data.zero_()
    hoz.room.room.bias.data = t(0, 0, 9, 0)[:]
    seen, state = views(BUILT_IN, 2), hoz.zero_state(2)
    moved = hoz(seen, state)[2]["zones"]
    assert not moved[:, [0, 1, 3]].any()
    rows = read_rows(seen.detections)
    row, _ = hoz.subgoal(torch.tensor([2, 2]), rows, seen.goal, state["zones"])
    for b in range(2):
        nodes, v = torch.tensor(known.zones[2]), rows.detected[b]
        here = int(((nodes - v) ** 2).sum(1).argmin())
        nodes[here] = 0.995 * nodes[here] + 0.005 * v
        torch.testing.assert_close(hoz.zones[2] + moved[b, 2], nodes)
        goal = int(nodes[:, int(seen.goal[b].argmax())].argmax())
        hop = int(first_hops(torch.tensor(known.zone_edges[2]))[here, goal])
        graph = normalised(torch.tensor(known.zone_edges[2]))
        torch.testing.assert_close(row[b], torch.relu(hoz.zone(graph @ nodes))[hop])
    # the second step starts from the moved nodes
    again = hoz(seen, {**state, "zones": moved})[2]["zones"]
    torch.testing.assert_close(again, moved * 1.995, rtol=1e-3, atol=1e-6)


def test_relation_encoder_step_by_step():
    torch.manual_seed(0)
    encoder = RelationEncoder(objects=3, appearance=4, info=2, code=5, side=2, mixes=2)
    codes = torch.rand(3, 5)
    appearance, info, goal, weight = torch.rand(3, 4), torch.rand(3, 2), t(0, 1, 0), torch.rand(3)
    a = torch.relu(encoder.first(torch.cat([info, goal[:, None]], 1))).t()
    for layer in encoder.mix:
        a = torch.relu(layer(a))
    mixed = (appearance.t() @ a).t()
    code = goal[:, None] * codes
    row = torch.relu(encoder.row(torch.cat([mixed, info, code], 1) * weight[:, None]))
    expected = encoder.map(row)
    rows = Rows(appearance[None], info[None], goal[None], goal[None], info[None])
    found = encoder(rows, goal[None], codes, weight[None])
    torch.testing.assert_close(found[0].flatten(1), expected)


PRIOR = t([[0, 2, 6], [1, 0, 3], [4, 4, 0]])


def test_layout_update_and_attention():
    goal, nothing = t([0, 0, 1]), torch.zeros(1, 3)
    torch.testing.assert_close(layout.attention(PRIOR, nothing, goal), t([6 / 8, 3 / 4, 1]))
    belief = layout.update(t([1, 1, 0]), nothing, nothing)
    assert belief.new.item()
    torch.testing.assert_close(belief.added, t([5, 5, 0]))
    torch.testing.assert_close(belief.last, t([1, 1, 0]))
    torch.testing.assert_close(
        layout.attention(PRIOR, belief.added, goal), t([6 / 18, 3 / 14, 0 / 18 + 1])
    )
    for old in (t([1, 1, 0]), t([0, 1, 0])):  # the same again, and a single object
        same = layout.update(old, belief.added, belief.last)
        assert not same.new.item()
        torch.testing.assert_close(same.added, belief.added)
        torch.testing.assert_close(same.last, belief.last)
    more = layout.update(t([1, 0, 1]), belief.added, belief.last)
    torch.testing.assert_close(more.added, t([10, 5, 5]))


def test_layout_gap_by_hand():
    # two rows Dir(6, 1) against Dir(1, 1): KL = log 6 + 5 E[log x] = log 6 - 5/6 each
    found = layout.gap(t([[0, 1], [1, 0]]), torch.zeros(1, 2), t([5, 0]))
    assert found.item() == pytest.approx(math.tanh(2 * (math.log(6) - 5 / 6)))


def test_dirichlet_divergence_against_torch():
    g = torch.Generator().manual_seed(0)
    q = 1 + 3000 * torch.rand(50, 22, generator=g, dtype=torch.float64) ** 4
    p = q + 5 * (torch.rand(50, 22, generator=g) > 0.5)
    expected = kl_divergence(Dirichlet(p), Dirichlet(q))
    torch.testing.assert_close(layout.dirichlet_kl(p, q), expected, rtol=1e-7, atol=1e-9)
    x = torch.linspace(1, 50, 99, dtype=torch.float64)
    torch.testing.assert_close(layout.lgamma(x), torch.lgamma(x), rtol=1e-10, atol=1e-10)
    torch.testing.assert_close(layout.digamma(x), torch.digamma(x), rtol=1e-10, atol=1e-10)


def test_subtract_counterfactual():
    y, without = t([1, 2], [1, 2], [1, 2]), t([3, 0], [3, 0], [3, 0])
    found = layout.subtract_counterfactual(y, without, t([0.7], [0.0], [2.0]), 0.5)
    expected = t([1.2 - 0.6, 2.4], [0.999 + 0.003, 1.998], [1.8 - 2.4, 3.6])
    torch.testing.assert_close(found, expected)


def lstde(threshold):
    torch.manual_seed(0)
    model = MODELS["lstde"](BUILT_IN, SMALL, knowledge(38)).eval()
    assert model.threshold == 0.5
    assert MODELS["akgvp"](BUILT_IN, SMALL, knowledge(38)).threshold is None
    model.threshold = threshold
    return model


def without_present(model):
    """The same model when picture and present relations say nothing."""
    for layer in (model.picture.layer, model.present.map):
        torch.nn.init.zeros_(layer.weight)
        torch.nn.init.zeros_(layer.bias)
    return model


def test_lstde_fades_its_layout_gap():
    model, seen = lstde(0.5), views(BUILT_IN, 2)
    _, _, first = model(seen, model.zero_state(2))
    prior = model.prior[seen.room.argmax(1)]
    fresh = layout.gap(prior, torch.zeros(2, 38), 5 * read_rows(seen.detections).detected)
    torch.testing.assert_close(first["gap"], 0.8 * fresh)
    _, _, second = model(seen, first)
    torch.testing.assert_close(second["gap"], 0.64 * first["gap"])


def test_lstde_subtracts_what_the_layout_alone_says():
    seen = views(BUILT_IN, 2)
    state = {**lstde(0.5).zero_state(2), "last": read_rows(seen.detections).detected}
    state["gap"] = t([1.0], [0.0])  # read as 0.64 and 0
    with torch.no_grad():
        full, after = lstde(0.5)(seen, state)[0], lstde(0.5)(seen, state)[2]
        y, _, plain = lstde(None)(seen, state)
        without = without_present(lstde(None))(seen, state)[0]
    torch.testing.assert_close(full[0], 1.14 * y[0] - 0.14 * without[0])
    torch.testing.assert_close(full[1], 0.999 * y[1] + 0.001 * without[1])
    torch.testing.assert_close(after["h"], plain["h"])


def test_lstde_removes_the_present_in_one_forward_of_two_while_training():
    seen = views(BUILT_IN, 1)
    many = rows_of(seen, torch.zeros(64, dtype=torch.long))
    model = lstde(None)
    zeros = model.zero_state(64)
    with torch.no_grad():
        kept, value = model(many, zeros)[1], model.train()(many, zeros)[1]
        removed = without_present(lstde(None))(many, zeros)[1]
    is_kept, is_removed = torch.isclose(value, kept), torch.isclose(value, removed)
    assert (is_kept ^ is_removed).all()
    assert 16 < is_kept.sum() < 48


def test_done_gate():
    logits, goal = torch.ones(2, 6), t([0, 1], [1, 0])
    gated = gate_done(logits, t([0.9, 0.5], [0.0, 0.5]), goal)
    torch.testing.assert_close(gated, t([1, 1, 1, 1, 1, 0.29], [1, 1, 1, 1, 1, 0]))


def test_object_graph_layer_by_layer():
    torch.manual_seed(0)
    known = knowledge(7, word=5)
    adjacency, words = normalised(torch.tensor(known.adjacency)), torch.tensor(known.words)
    graph = ObjectGraph(adjacency, words, context=5, width=9)
    context = torch.rand(2, 7, 5)
    context[:, :, 0] = context[:, :, 0].round()
    for b in range(2):
        there = context[b, :, 0].expand(7, 7)
        x = torch.cat([there, words], 1)
        for layer in (graph.first, graph.second, graph.third):
            x = torch.relu(layer(adjacency @ x))
        x = torch.relu(graph.last(adjacency @ torch.cat([x, context[b]], 1)))
        torch.testing.assert_close(graph(context)[b], graph.out(x[:, 0]))


def test_mjolnir_context_has_the_similarity_of_words(monkeypatch):
    known = replace(knowledge(3), words=t([3, 4], [4, 3], [0, -2]).numpy())
    model = MODELS["mjolnir"](replace(BUILT_IN, objects=("A", "B", "C")), SMALL, known)
    seen = views(replace(BUILT_IN, objects=("A", "B", "C")), 1)
    seen = replace(seen, goal=t([1, 0, 0]))
    given = []
    monkeypatch.setattr(model.graph, "forward", lambda c: given.append(c) or torch.zeros(1, 16))
    model(seen, model.zero_state(1))
    torch.testing.assert_close(given[0][0, :, 5], t(1, 0.96, -0.8)[:])
    torch.testing.assert_close(given[0][:, :, :5], read_rows(seen.detections).context)


def test_tdanet_knows_objects_by_their_words_only():
    torch.manual_seed(0)
    known, seen = knowledge(38), views(BUILT_IN, 3)
    model = MODELS["tdanet"](BUILT_IN, SMALL, known).eval()
    order = torch.randperm(38)
    shuffled = replace(seen, detections=seen.detections[:, order], goal=seen.goal[:, order])
    more = torch.cat([torch.tensor(known.words)[order], torch.randn(4, 12)])
    shuffled = replace(
        shuffled, detections=torch.cat([shuffled.detections, torch.zeros(3, 4, 5)], 1),
        goal=torch.cat([shuffled.goal, torch.zeros(3, 4)], 1),
    )  # fmt: skip
    objects = tuple(f"Object{i}" for i in range(42))
    other = MODELS["tdanet"](
        replace(BUILT_IN, objects=objects), SMALL, replace(knowledge(42), words=more.numpy())
    ).eval()
    other.load_state_dict(model.state_dict())
    state = model.zero_state(3)
    torch.testing.assert_close(other(shuffled, state)[0], model(seen, state)[0])


def test_tdanet_without_anything_in_view():
    model = MODELS["tdanet"](BUILT_IN, SMALL, knowledge(38)).eval()
    seen = replace(views(BUILT_IN, 2), detections=torch.zeros(2, 38, 5))
    assert model(seen, model.zero_state(2))[0].isfinite().all()
    rows = read_rows(seen.detections)
    view = model.encoder(rows.context, rows.detected, seen.goal, model.words, torch.rand(2, 38))
    assert not view.any()
