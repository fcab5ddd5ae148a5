"""The contract of all models, their published sizes, and what they say to bad input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
import torch.fx.experimental._config
from torch import nn

from cfnav_core.agent.agent import new_agent
from cfnav_core.agent.config import RunConfig
from cfnav_core.models.base import Knowledge, ModelInput, ObservationSpec
from cfnav_core.models.parts.heads import ActorCritic
from cfnav_core.models.size import PUBLISHED, ModelSize
from cfnav_core.models.table import MODELS
from cfnav_core.task.detections import SCORES
from tests.core.model_samples import (
    BUILT_IN,
    DATA1,
    DATA1_CLIP,
    DATA2,
    SMALL,
    knowledge,
    rows_of,
    views,
)

ALL = sorted(MODELS)


@pytest.fixture(scope="module", params=ALL)
def model(request):
    torch.manual_seed(0)
    return MODELS[request.param](BUILT_IN, SMALL, knowledge(38)).eval()


def drive(model, batch=3, steps=2):
    """State after a few steps of random views, so that nothing in it is zero by chance."""
    state = model.zero_state(batch)
    for t in range(steps):
        _, _, state = model(views(BUILT_IN, batch, seed=t + 10), state)
    return {k: v.detach() for k, v in state.items()}


def first_cell(model) -> nn.LSTMCell:
    heads = [m for m in model.modules() if isinstance(m, ActorCritic)]
    return heads[0].cells[0] if heads else model.lstm


def test_shapes_and_state(model):
    state = model.zero_state(3)
    assert all(not v.any() for v in state.values())
    logits, value, after = model(views(BUILT_IN, 3), state)
    assert logits.shape == (3, 6)
    assert value.shape == (3, 1)
    assert {k: v.shape for k, v in after.items()} == {k: v.shape for k, v in state.items()}
    assert {k: v.dtype for k, v in after.items()} == dict.fromkeys(state, torch.float32)
    moved = {k for k in state if not torch.equal(state[k], after[k])}
    # AKGVP's layout gap stands still while its counterfactual pass is off
    assert moved >= set(state) - {"gap"}


def test_state_advances_only_through_what_is_returned(model):
    seen, state = views(BUILT_IN, 3), drive(model)
    kept = {k: v.clone() for k, v in state.items()}
    before = {k: v.clone() for k, v in [*model.named_parameters(), *model.named_buffers()]}
    first, second = model(seen, state), model(seen, state)
    assert torch.equal(first[0], second[0])
    assert torch.equal(first[1], second[1])
    for k in state:
        assert torch.equal(state[k], kept[k])
        assert torch.equal(first[2][k], second[2][k])
    for k, v in [*model.named_parameters(), *model.named_buffers()]:
        assert torch.equal(v, before[k]), k


READ = {
    "compact": {"features", "detections"},
    "baseline_label": {"features", "detections"},
    "baseline_word": {"features"},
    "hoz": {"features", "detections"},  # its room type is the one it predicts
    "lstde": {"features", "detections", "room"},
    "akgvp": {"features", "detections", "room"},
    "mjolnir": {"features", "detections"},
    "tdanet": {"detections"},
}


@pytest.mark.parametrize("field", ["features", "detections", "room", "goal", "previous_action"])
def test_a_model_reads_what_it_should_and_no_more(model, field):
    name = next(n for n, constructor in MODELS.items() if type(model) is constructor)
    seen, state = views(BUILT_IN, 3), drive(model)
    other = replace(seen, **{field: getattr(views(BUILT_IN, 3, seed=5), field)})
    changed = not torch.equal(model(seen, state)[1], model(other, state)[1])
    assert changed == (field in READ[name] | {"goal", "previous_action"})


def test_p_hat_changes_the_answer_and_zero_leaves_its_column_out(model):
    seen, state = views(BUILT_IN, 3), drive(model)
    zero = replace(seen, collision_probability=torch.zeros(3, 1))
    one = replace(seen, collision_probability=torch.ones(3, 1))
    plain = model(zero, state)
    assert (model(one, state)[0] != plain[0]).any(1).all()
    column = first_cell(model).weight_ih.data[:, -1]
    kept = column.clone()
    column += 1
    assert torch.equal(model(zero, state)[0], plain[0])
    column.copy_(kept)


@pytest.mark.parametrize("name", ["compact", "lstde", "tdanet"])
def test_a_listening_model_adds_p_hat_to_its_answer(name):
    config = RunConfig(model=name, size=SMALL, listening=True)
    agent = new_agent(config, BUILT_IN, knowledge(38))
    listening = agent.model.eval()
    inner, state = listening.model, listening.zero_state(3)
    seen = views(BUILT_IN, 3)
    for given, expected in zip(listening(seen, state), inner(seen, state), strict=True):
        torch.testing.assert_close(given, expected)
    weight = torch.arange(6.0)
    listening.weight.data.copy_(weight)
    moved = listening(seen, state)[0] - inner(seen, state)[0]
    torch.testing.assert_close(moved, seen.collision_probability * weight)
    assert any(p is listening.weight for p in agent.parameters()[0])


def test_episodes_of_a_batch_do_not_influence_one_another(model):
    seen, state = views(BUILT_IN, 3), drive(model)
    logits, value, after = model(seen, state)
    for i in range(3):
        row = slice(i, i + 1)
        alone = model(rows_of(seen, row), {k: v[row] for k, v in state.items()})
        torch.testing.assert_close(alone[0], logits[row], rtol=1e-4, atol=1e-6)
        torch.testing.assert_close(alone[1], value[row], rtol=1e-4, atol=1e-6)
        for k in state:
            torch.testing.assert_close(alone[2][k], after[k][row], rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("name", ALL)
def test_every_weight_gets_a_finite_gradient(name):
    torch.manual_seed(0)
    size = replace(SMALL, dropout=0.25)
    model = MODELS[name](BUILT_IN, size, knowledge(38)).train()
    state, total = model.zero_state(8), torch.zeros(())
    for t in range(3):
        logits, value, state = model(views(BUILT_IN, 8, seed=t), state)
        total = total + torch.log_softmax(logits, 1)[:, 0].sum() + value.sum()
    total.backward()
    for key, weight in model.named_parameters():
        if key == "update_rate":  # HOZ's scalar is counted among the trainable and never moves
            assert weight.grad is None
            continue
        assert weight.grad is not None, key
        assert weight.grad.isfinite().all(), key
        assert weight.grad.any(), key


@pytest.mark.parametrize("training", [True, False])
@pytest.mark.parametrize("name", ALL)
def test_nothing_stays_behind_when_a_model_moves_to_another_device(name, training):
    # the meta device has shapes only, but refuses to meet tensors of the CPU
    model = MODELS[name](BUILT_IN, SMALL, knowledge(38)).to("meta").train(training)
    seen = ModelInput(*(value.to("meta") for value in vars(views(BUILT_IN, 3)).values()))
    # without values nobody knows which objects are seen: all are
    with torch.fx.experimental._config.patch(meta_nonzero_assume_all_nonzero=True):
        logits, _, state = model(seen, model.zero_state(3))
    assert logits.is_meta
    assert all(value.is_meta for value in state.values())


PUBLISHED_COUNTS = {
    "baseline_word": (DATA2, 7_539_853),
    "baseline_label": (DATA1, 9_676_964),
    "hoz": (DATA1, 9_747_023),
    "lstde": (DATA1, 9_801_791),
    "akgvp": (DATA1_CLIP, 10_161_983),
    "mjolnir": (DATA2, 8_974_471),
}


@pytest.mark.parametrize("name", PUBLISHED_COUNTS)
def test_published_sizes(name):
    inputs, count = PUBLISHED_COUNTS[name]
    known = knowledge(len(inputs.objects), word=300, text=1024)
    model = MODELS[name](inputs, PUBLISHED, known).eval()
    p_hat_column = 4 * 512
    assert sum(p.numel() for p in model.parameters()) == count + p_hat_column
    logits, value, _ = model(views(inputs, 2), model.zero_state(2))
    assert logits.isfinite().all()
    assert value.shape == (2, 1)


@pytest.mark.parametrize("name", sorted(set(ALL) - {"tdanet"}))
def test_dropout_is_for_training_alone(name):
    model = MODELS[name](BUILT_IN, replace(SMALL, dropout=0.5), knowledge(38))
    seen, state = views(BUILT_IN, 3), model.zero_state(3)
    first, again = (model.train()(seen, state)[0] for _ in range(2))
    assert not torch.equal(first, again)
    first, again = (model.eval()(seen, state)[0] for _ in range(2))
    assert torch.equal(first, again)


def test_compact_checkpoints_of_the_former_baseline_load():
    model = MODELS["compact"](BUILT_IN, ModelSize(), Knowledge())
    assert {k: tuple(v.shape) for k, v in model.state_dict().items()} == {
        "picture.0.weight": (256, 446), "picture.0.bias": (256,), "goal.weight": (32, 38),
        "target.0.weight": (64, 37), "target.0.bias": (64,),
        "action.0.weight": (10, 6), "action.0.bias": (10,),
        "lstm.weight_ih": (1024, 331), "lstm.weight_hh": (1024, 256),
        "lstm.bias_ih": (1024,), "lstm.bias_hh": (1024,),
        "actor.weight": (6, 256), "actor.bias": (6,), "critic.weight": (1, 256),
        "critic.bias": (1,),
    }  # fmt: skip
    assert model.state_shapes == {"h": (256,), "c": (256,)}


def test_titles_are_the_papers_names():
    titles = {name: model.title for name, model in MODELS.items()}
    assert titles == {
        "compact": "compact", "baseline_label": "Baseline (label)",
        "baseline_word": "Baseline (word)", "hoz": "HOZ", "lstde": "L-sTDE", "akgvp": "AKGVP",
        "mjolnir": "MJOLNIR-r", "tdanet": "TDANet-style",  # its layers are not public
    }  # fmt: skip


NEEDS = {
    "baseline_word": ["words"], "hoz": ["zones", "zone_edges"], "lstde": ["layout"],
    "akgvp": ["layout", "text"], "mjolnir": ["words", "adjacency"], "tdanet": ["words"],
}  # fmt: skip


@pytest.mark.parametrize(("name", "table"), [(n, t) for n, ts in NEEDS.items() for t in ts])
def test_missing_and_foreign_tables(name, table):
    known = knowledge(38)
    with pytest.raises(ValueError, match=f"found no {table} among"):
        MODELS[name](BUILT_IN, SMALL, replace(known, **{table: None}))
    foreign = np.delete(getattr(known, table), 0, 0 if table in ("words", "text") else -1)
    with pytest.raises(ValueError, match=f"found {table} of shape .*, expected"):
        MODELS[name](BUILT_IN, SMALL, replace(known, **{table: foreign}))


def test_unknown_detections_and_features():
    for name in sorted(set(ALL) - {"compact", "baseline_label", "baseline_word"}):
        with pytest.raises(ValueError, match="found detections with the fields x, y, expected"):
            MODELS[name](replace(BUILT_IN, fields=("x", "y")), SMALL, knowledge(38))
    with pytest.raises(ValueError, match=r"found picture features of shape \(8, 7, 5\)"):
        MODELS["hoz"](ObservationSpec((8, 7, 5), SCORES, BUILT_IN.objects), SMALL, knowledge(38))


def test_layout_counts_must_be_positive():
    known = knowledge(38)
    layout = np.array(known.layout)
    layout[2, 3, 4] = 0
    with pytest.raises(ValueError, match="found a layout count of 0"):
        MODELS["lstde"](BUILT_IN, SMALL, replace(known, layout=layout))


def test_start_of_the_weights():
    torch.manual_seed(0)
    hoz = MODELS["hoz"](BUILT_IN, ModelSize(hidden=32), knowledge(38))
    torch.testing.assert_close(hoz.policy.actor.weight.norm(dim=1), torch.full((6,), 0.01))
    for layer, rows in zip(hoz.policy.critic, (64, 1), strict=True):
        torch.testing.assert_close(layer.weight.norm(dim=1), torch.ones(rows))
        assert not layer.bias.any()
    for cell in hoz.policy.cells:
        assert not cell.bias_ih.any()
        assert not cell.bias_hh.any()
        assert cell.weight_ih.std() > 0
    glorot = (6 / (256 + 64 * 9)) ** 0.5
    largest = hoz.picture.layer.weight.abs().max()
    assert 0.99 * glorot * 2**0.5 < largest <= glorot * 2**0.5
    assert not hoz.picture.layer.bias.any()
    # made after the published hook: PyTorch's own start, biases too
    assert hoz.room.room.bias.any()
    assert hoz.zone.weight.abs().max() <= 38**-0.5
