"""How well goals are found by what stands for them."""

from __future__ import annotations

import numpy as np
import pytest
from sim_bridge.room.room import generate_room

from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Episodes, Evaluation
from cfnav_core.task.metrics import EpisodeResult
from studies.worlds import by_model
from studies.worlds.by_model import DRAWN, KNOWN, SEVERAL, UNKNOWN, kinds_of, rows
from tests.core.worlds import hall


def test_a_goal_of_a_test_room_is_an_unknown_model_only_where_there_is_one() -> None:
    found = {f"{kind}:{seed}": kinds_of(generate_room(f"cc0.{kind}", seed))
             for kind in ("kitchen", "bedroom") for seed in (25, 300, 301)}  # fmt: skip
    unknown = by_model.held_out_models("cc0")
    assert unknown
    for room, kinds in found.items():
        assert DRAWN in kinds.values()
        if room.endswith(":25"):  # "sparse" furniture may stand in any test room alone
            assert KNOWN in kinds.values()
    room = generate_room("cc0.kitchen", 300)
    owners = {owner: one.model.id for one in room.placed for owner in one.owners}
    said = kinds_of(room)
    for index, thing in enumerate(room.objects):
        if said[thing.name] == UNKNOWN:
            assert owners[index] in unknown
        if said[thing.name] == DRAWN:
            assert index not in owners


def test_episodes_are_counted_by_what_stands_for_their_goal(monkeypatch) -> None:
    bank = SceneBank([hall(name="kitchen:0"), hall(name="kitchen:1")])
    laptop, mug = (bank.objects.index(name) for name in ("Laptop", "Mug"))
    starts = np.array([0, 1, bank.offsets[1], bank.offsets[1] + 1])
    results = [EpisodeResult(ok, hits, 3, 3) for ok, hits in ((True, 0), (True, 1), (False, 0))]
    results.append(EpisodeResult(True, 0, 3, 3))
    goals = np.array([laptop, mug, laptop, mug])
    made = Evaluation({}, ("Laptop",), bank, Episodes(starts, goals), results, [])
    with pytest.raises(ValueError, match="kitchen:0 made by another version"):
        rows(made)
    kinds = {"kitchen:0": {"Laptop": UNKNOWN, "Mug": KNOWN}}
    kinds["kitchen:1"] = {"Laptop": SEVERAL, "Mug": KNOWN}
    monkeypatch.setattr(by_model, "room_of", lambda name, source: name)
    monkeypatch.setattr(by_model, "kinds_of", lambda name: kinds[name])
    found = {row["kind"]: row for row in rows(made)}
    assert {kind: row["episodes"] for kind, row in found.items()} == {
        UNKNOWN: 1,
        KNOWN: 2,
        SEVERAL: 1,
    }
    assert (found[KNOWN]["cf_sr"], found[KNOWN]["sr"]) == (0.5, 1.0)
    assert found[KNOWN]["goals"] == ["Mug"]
