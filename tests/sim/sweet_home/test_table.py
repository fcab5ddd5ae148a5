"""The table of models: roles, what is held out, and models that are turned or sized otherwise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import yaml
from sim_bridge.sweet_home.catalogue import SweetHomeError, shipped
from sim_bridge.sweet_home.table import TABLE, VARIABLE, _cast, pieces

from cfnav_core.task.vocabulary import CATEGORY_ID


@pytest.fixture
def with_table(furnish, tmp_path, monkeypatch):
    def make(**roles):
        furnish(*({"id": f"Test#{k}"} for k in range(6)))
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.yaml"
        path.write_text(yaml.safe_dump(roles))
        monkeypatch.setenv(VARIABLE, str(path))
        return pieces()

    return make


def test_the_last_of_three_is_held_out_and_a_family_goes_with_its_first(with_table):
    rows = [{"id": f"Test#{k}"} for k in range(6)]
    assert [p.held_out for p in with_table(sofa=rows)["sofa"]] == [False, False, True] * 2
    rows[1] = {"id": "Test#1", "family": "a"}
    rows[2] = {"id": "Test#2", "family": "a"}
    assert [p.held_out for p in with_table(sofa=rows)["sofa"]] == [False] * 5 + [True]
    rows[5]["held_out"] = False
    assert not any(p.held_out for p in with_table(sofa=rows)["sofa"])


def test_a_quarter_turn_brings_the_right_side_to_the_front(with_table):
    plain, turned = with_table(hob=[{"id": "Test#0"}, {"id": "Test#0", "turn": -90}])["hob"]
    assert turned.entry.size == (0.04, 0.4, 0.2)
    front = next(mesh for mesh in plain.load().meshes if mesh.texture is not None)
    side = next(mesh for mesh in turned.load().meshes if mesh.texture is not None)
    assert np.ptp(front.vertices[:, 1]) == pytest.approx(0, abs=1e-6)
    # what was in front of the plain one is at a side now
    assert np.ptp(side.vertices[:, 0]) == pytest.approx(0, abs=1e-6)
    assert np.ptp(side.vertices[:, 1]) == pytest.approx(0.4, abs=1e-6)


def test_a_model_that_is_not_installed_is_one_sentence(with_table):
    with pytest.raises(SweetHomeError, match="found no Test#lost in the installed furniture"):
        with_table(sofa=[{"id": "Test#lost"}])


HELD_OUT = {
    "ArmChair": {
        "Scopia#armchair1",
        "Blend Swap CC-BY#leaf_chair",
        "Scopia#armchair2",
        "Kator Legaz#chair-ottoman",
        "Blend Swap CC-0#armchair2",
    },
    "Bowl": {"Scopia#bowlWithFruits"},
    "Chair": {
        "Blend Swap CC-0#osakaChair",
        "Scopia#tubular_chair",
        "Scopia#silla_teca",
        "Blend Swap CC-BY#childChair",
        "Blend Swap CC-0#oakChair",
        "Blend Swap CC-BY#foldingChair",
        "Blend Swap CC-0#chair",
        "Blend Swap CC-0#armchair",
        "Kator Legaz#dining-chair",
        "Scopia#chair3",
        "Blend Swap CC-BY#plaidChair",
    },
    "CoffeeMachine": {"Blend Swap CC-0#coffeeBrewer"},
    "DeskLamp": {"Kator Legaz#pedestal-vase-lamp", "Scopia#desk_lamp1"},
    "Fridge": {"Blend Swap CC-0#refrigerator"},
    "HousePlant": {
        "Blend Swap CC-0#littlePlant",
        "Blend Swap CC-BY#decorativePlant",
        "Blend Swap CC-0#augalas",
        "Blend Swap CC-BY#mediumIndoorPlant",
    },
    "LightSwitch": {
        "Scopia#rounded-dimmer",
        "Scopia#rounded-double-switch",
        "Scopia#rounded-switch",
    },
    "Mug": {"Blend Swap CC-0#caffe_final"},
    "Sink": {"Blend Swap CC-0#modernVanity", "Scopia#bathroom3", "Scopia#bathroom1"},
    "StoveBurner": {"Blend Swap CC-0#mano_cooktop"},
    "Vase": {"Scopia#vase1"},
}
"""Of each goal that has such models, those that stand in test rooms alone."""


def test_no_model_changes_sides_unnoticed():
    """Policies and perceptions were trained without these: a row that is added moves none."""
    any_entry = next(iter(shipped().values()))
    table = _cast(TABLE, lambda role, name: replace(any_entry, id=name))
    found = {
        role: {piece.entry.id for piece in its if piece.held_out}
        for role, its in table.items()
        if role in CATEGORY_ID
    }
    assert {role: names for role, names in found.items() if names} == HELD_OUT


def test_goals_inside_models_are_categories():
    rows = yaml.safe_load(TABLE.read_text())
    named = [row for role in rows if role != "left_out" for row in rows[role] if "goals" in row]
    assert len(named) > 10
    assert {goal for row in named for goal in row["goals"].values()} <= set(CATEGORY_ID)
    ids = [row["id"] for role in rows if role != "left_out" for row in rows[role]]
    assert not set(ids) & {i for reason in rows["left_out"].values() for i in reason}
