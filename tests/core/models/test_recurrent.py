"""Weight gradients summed once a rollout equal those summed step by step."""

from __future__ import annotations

import copy

import pytest
import torch

from cfnav_core.agent.collision_predictor import CollisionPredictor
from cfnav_core.models.parts.recurrent import LSTMCell, weight_gradients_at_once
from cfnav_core.models.table import MODELS
from tests.core.model_samples import BUILT_IN, SMALL, knowledge, views

STEPS = 4


def learn(model, predictor) -> None:
    """Gradients of something that depends on every step."""
    torch.manual_seed(1)  # some models toss coins while they train
    state, memory, loss = model.zero_state(3), torch.zeros(3, *predictor.state_shape), 0.0
    for t in range(STEPS):
        seen = views(BUILT_IN, 3, seed=t)
        logit, memory = predictor(seen.features, seen.previous_action, memory)
        logits, value, state = model(seen, state)
        loss = loss + torch.log_softmax(logits, 1)[:, t].sum() + value.sum() ** 2 + logit.sum() ** 2
    loss.backward()


@pytest.mark.parametrize("name", MODELS)
def test_gradients_are_those_of_every_step(name):
    torch.manual_seed(0)
    plain = MODELS[name](BUILT_IN, SMALL, knowledge(38)), CollisionPredictor((256,), 8)
    other = copy.deepcopy(plain)
    learn(*plain)
    with weight_gradients_at_once(*other):
        learn(*other)
    for one, two in zip(plain, other, strict=True):
        gradients = dict(two.named_parameters())
        for key, parameter in one.named_parameters():
            if parameter.grad is None:
                assert gradients[key].grad is None
            else:
                torch.testing.assert_close(gradients[key].grad, parameter.grad, msg=key)


def test_gradients_are_added_to_those_that_are_there():
    cell = LSTMCell(4, 5)
    x, h = torch.randn(3, 4), torch.zeros(3, 5)
    for _ in range(2):
        with weight_gradients_at_once(cell):
            cell.step(x, h, h)[0].sum().backward()
    twice = cell.weight_ih.grad.clone()
    cell.zero_grad()
    cell.step(x, h, h)[0].sum().backward()
    torch.testing.assert_close(twice, 2 * cell.weight_ih.grad)


def test_steps_without_gradients_leave_nothing_behind():
    cell = LSTMCell(4, 5)
    with weight_gradients_at_once(cell), torch.no_grad():
        cell.step(torch.randn(3, 4), torch.zeros(3, 5), torch.zeros(3, 5))
    assert cell.weight_ih.grad is None
    h, _ = cell.step(torch.randn(3, 4), torch.zeros(3, 5), torch.zeros(3, 5))
    h.sum().backward()
    assert cell.weight_ih.grad is not None


@pytest.mark.parametrize("taped", [False, True])
def test_a_sequence_of_predictions_equals_those_step_by_step(taped):
    torch.manual_seed(0)
    one = CollisionPredictor((256,), 8)
    other = copy.deepcopy(one)
    features, ended = torch.rand(STEPS, 3, 256), torch.rand(STEPS, 3) < 0.3
    actions = torch.eye(6)[torch.randint(6, (STEPS, 3))]
    start = memory = torch.randn(3, *one.state_shape)
    logits = []
    for t in range(STEPS):
        logit, memory = one(features[t], actions[t], memory)
        logits.append(logit[:, 0])
        memory = memory.masked_fill(ended[t][:, None, None], 0.0)
    (torch.cat(logits).square().sum() + memory.square().sum()).backward()
    with weight_gradients_at_once(*([other] if taped else [])):
        found, last = other.sequence(features.flatten(0, 1), actions.flatten(0, 1), start, ended)
        (found.square().sum() + last.square().sum()).backward()
    assert ended.any()
    torch.testing.assert_close(found, torch.cat(logits))
    torch.testing.assert_close(last, memory)
    for (name, a), b in zip(one.named_parameters(), other.parameters(), strict=True):
        torch.testing.assert_close(b.grad, a.grad, msg=name)
