"""Where things were seen, carried along as the robot moves."""

import math

import pytest
import torch
from torch import Tensor

from cfnav_core.models.parts.places import FOUND, Places
from cfnav_core.models.tdanet import TDANet
from cfnav_core.task.actions import NUM_ACTIONS, STEP_M, TURN_RAD, Action
from tests.core.model_samples import BUILT_IN, SIGHTED, SMALL, knowledge, views

AHEAD, LEFT, RIGHT = Action.MoveAhead, Action.RotateLeft, Action.RotateRight


def one_hot(action: Action | None) -> Tensor:
    return torch.eye(NUM_ACTIONS)[[action]] if action is not None else torch.zeros(1, NUM_ACTIONS)


def sighted(azimuth: float = 0.0, distance: float = 1.0, elevation: float = 0.0) -> Places:
    values = (0.9, azimuth, elevation, 0.2, 0.1, distance)
    return Places.of_sightings(*torch.tensor(values).reshape(-1, 1, 1).unbind(0))


def nothing() -> Places:
    return Places.of_sightings(*torch.zeros(6, 1, 1).unbind(0))


def numbers(of: Places) -> dict[str, float]:
    return {name: float(value) for name, value in of._asdict().items()}


@pytest.mark.parametrize("azimuth", [-0.6, 0.0, 0.4])
def test_a_place_stays_where_it_is_whatever_the_robot_does(azimuth: float) -> None:
    """Beside the same way walked by a pose in the plane, y to the left."""
    distance, height = 2.0, 0.5
    thing = distance * math.cos(azimuth), -distance * math.sin(azimuth)
    known, x, y, yaw = sighted(azimuth, distance, math.atan2(height, distance)), 0.0, 0.0, 0.0
    for action in (AHEAD, LEFT, AHEAD, AHEAD, RIGHT, RIGHT, AHEAD, LEFT, LEFT, LEFT, AHEAD):
        known = known.after(one_hot(action))
        if action == AHEAD:
            x, y = x + STEP_M * math.cos(yaw), y + STEP_M * math.sin(yaw)
        yaw += {LEFT: TURN_RAD, RIGHT: -TURN_RAD}.get(action, 0.0)
        dx, dy = thing[0] - x, thing[1] - y
        far = math.hypot(dx, dy)
        found = numbers(known)
        ahead = (math.cos(yaw) * dx + math.sin(yaw) * dy) / far
        right = (math.sin(yaw) * dx - math.cos(yaw) * dy) / far
        assert (found["ahead"], found["right"]) == pytest.approx((ahead, right), abs=1e-5)
        assert (found["distance"], found["rise"]) == pytest.approx((far, height / far), abs=1e-4)
        assert found["width"] == pytest.approx(0.2 * distance / far, rel=1e-4)
    assert numbers(known)["age"] == 11


def test_of_a_thing_at_no_known_distance_only_the_direction_turns() -> None:
    seen = sighted(0.3, 0.0)
    assert numbers(seen.after(one_hot(AHEAD))) == numbers(seen) | {"age": 1}
    turned = numbers(seen.after(one_hot(LEFT)))
    assert math.atan2(turned["right"], turned["ahead"]) == pytest.approx(0.3 + TURN_RAD)


def test_what_was_never_seen_is_nothing_wherever_the_robot_goes() -> None:
    known = nothing()
    for action in (AHEAD, LEFT, Action.LookUp, AHEAD):
        known = known.after(one_hot(action)).with_new(nothing(), one_hot(action))
    assert not known.write().any()
    assert not known.context().any()


def test_the_robot_may_reach_a_place_and_drive_past() -> None:
    known = sighted(0.0, 0.25)
    for _ in range(3):
        known = known.after(one_hot(AHEAD))
        assert torch.isfinite(known.context()).all()
    assert numbers(known)["ahead"] == pytest.approx(-1)
    assert numbers(known)["distance"] == pytest.approx(0.5, abs=0.06)


@pytest.mark.parametrize(
    ("azimuth", "distance", "times"),
    [(0.0, 0.75, 2), (0.25, 0.75, 2), (0.5, 0.75, 1), (0.0, 1.1, 2), (0.0, 1.3, 1), (0.3, 0.0, 2)],
)
def test_a_sighting_where_it_was_expected_confirms(
    azimuth: float, distance: float, times: int
) -> None:
    known = sighted(0.0, 1.0).after(one_hot(AHEAD))
    known = known.with_new(sighted(azimuth, distance), one_hot(AHEAD))
    found = numbers(known)
    assert (found["times"], found["age"]) == (times, 0)
    assert found["distance"] == pytest.approx(distance)


def test_a_second_look_from_the_same_place_confirms_nothing() -> None:
    known = sighted()
    for action in (Action.LookUp, Action.LookDown):
        known = known.after(one_hot(action)).with_new(sighted(), one_hot(action))
    assert numbers(known)["times"] == 1


def test_a_confirmed_place_outlives_a_sighting_elsewhere_until_it_is_old() -> None:
    known = sighted(0.0, 1.5).after(one_hot(AHEAD)).with_new(sighted(0.0, 1.25), one_hot(AHEAD))
    alarm = sighted(-0.5, 3.0)
    for age in range(1, 8):
        known = known.after(one_hot(None)).with_new(alarm, one_hot(None))
        assert numbers(known)["distance"] == 1.25
        assert numbers(known)["age"] == age
    known = known.after(one_hot(None)).with_new(alarm, one_hot(None))
    assert numbers(known)["distance"] == 3.0
    once = sighted(0.0, 1.5).with_new(alarm, one_hot(AHEAD))
    assert numbers(once)["distance"] == 3.0


def test_a_model_is_told_of_what_it_no_longer_sees() -> None:
    """The goal was seen once; what the model answers later depends on where that was."""
    model, seen = TDANet(SIGHTED, SMALL, knowledge(38)).eval(), views(SIGHTED, 1)
    assert model.encoder.width == 128 + 7 + len(FOUND)
    with torch.no_grad():
        answers = []
        for azimuth in (-0.5, 0.5):
            first = torch.zeros_like(seen.detections)
            first[0, int(seen.goal.argmax())] = torch.tensor([0.9, azimuth, 0.0, 0.2, 0.2, 1.0])
            state = model.zero_state(1)
            # the recurrent memory is taken away: only the place is left
            fresh = {k: v for k, v in model.zero_state(1).items() if k != "places"}
            for detections in (first, torch.zeros_like(first)):
                now = type(seen)(**{**vars(seen), "detections": detections})
                logits, _, state = model(now, {**state, **fresh})
            answers.append(logits)
    assert not torch.allclose(*answers)


def test_a_model_of_pictures_remembers_no_places() -> None:
    assert "places" not in TDANet(BUILT_IN, SMALL, knowledge(38)).state_shapes
