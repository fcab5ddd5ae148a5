"""The study of training rooms: sets that hold each other, runs that go on, tables and a picture."""

import json
from dataclasses import replace

import numpy as np
import pytest

from cfnav_core.agent.config import Hyperparameters, RunConfig
from cfnav_core.models.size import ModelSize
from cfnav_core.task.rooms import parse_rooms
from studies.worlds import room_curve
from studies.worlds.room_curve import KINDS, RoomCurve, rooms_of
from tests.core.worlds import hall


def test_more_rooms_hold_the_fewer_ones_and_as_many_of_each_kind():
    before: set = set()
    for count in RoomCurve.counts:
        rooms = parse_rooms(rooms_of(count))
        assert len(rooms) == count
        assert {kind: len([k for k, _ in rooms if k == kind]) for kind in KINDS} == dict.fromkeys(
            KINDS, count // len(KINDS)
        )
        assert before < set(rooms)
        before = set(rooms)
    assert set(parse_rooms(rooms_of(1000))) == set(
        parse_rooms(["worlds:train", "sweet_home.worlds:train"])
    )
    assert not before & set(parse_rooms(["worlds:validation", "sweet_home.worlds:validation"]))


@pytest.mark.parametrize("count", [0, 4, 100, 1008])
def test_numbers_of_rooms_that_cannot_be(count):
    with pytest.raises(ValueError, match=r"expected a multiple of 8 .* up to 1000"):
        rooms_of(count)


VALIDATION = {"230", "231", "232", "233", "234"}
JUDGE = {"232", "233", "234"}


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("curve")
    seeds = (100, 101, *map(int, sorted(VALIDATION)))
    for number, (kind, seed) in enumerate((kind, seed) for kind in KINDS for seed in seeds):
        made = replace(
            hall(4, 3, seed=number, name=f"{kind}:{seed}"), room_type=kind.split(".")[-1]
        )
        made.save(folder / "scenes" / f"{kind}_{seed:05d}")
    small = RunConfig(
        hyperparameters=Hyperparameters(stage1_episodes=40, stage2_episodes=80, batch=8),
        size=ModelSize(hidden=16, channels=8), predictor_hidden=8,
    )  # fmt: skip
    return RoomCurve(
        folder / "scenes", folder / "out", counts=(16, 8), run=small, validation_every=40,
        validation_episodes=20, episodes=60,
    )  # fmt: skip


def test_the_curve_is_measured_goes_on_and_is_drawn(study, monkeypatch):
    made = []
    monkeypatch.setattr(
        room_curve,
        "train",
        lambda options, of=room_curve.train: made.append(options) or of(options),
    )
    first = room_curve.measure(replace(study, counts=(8,)))
    assert [row["rooms"] for row in first] == [8]
    room_curve.main(study)
    assert [len(parse_rooms(options.train_rooms)) for options in made] == [8, 16]
    lines = (study.out / "room_curve.jsonl").read_text().splitlines()
    rows = [json.loads(line) for line in lines]
    assert rows[0] == first[0]
    for row in rows:
        new = row["new"]
        assert len(new["cf_success"]) == len(new["in_room"]) == study.episodes
        assert new["cf_sr"] == pytest.approx(np.mean(new["cf_success"]))
        assert {name.partition(":")[2] for name in new["in_room"]} <= JUDGE
        assert {name.partition(":")[2] for name in row["known"]["in_room"]} == {"100"}
    with pytest.raises(ValueError, match="found other episodes for 16 rooms than for 8"):
        room_curve.gains([rows[0], {**rows[1], "new": {**rows[1]["new"], "episodes": "others"}}])
    with pytest.raises(ValueError, match="found other scenes for 16 rooms than for 8"):
        room_curve.gains([rows[0], {**rows[1], "new": {**rows[1]["new"], "scenes": ["others"]}}])
    (gain,) = room_curve.gains(rows)
    assert gain["rooms"] == 16
    assert gain["cf_sr_difference"] == pytest.approx(
        rows[1]["new"]["cf_sr"] - rows[0]["new"]["cf_sr"]
    )
    text = (study.out / "room_curve.md").read_text()
    assert [line.split("|")[1].strip() for line in text.splitlines()[2:4]] == ["8", "16"]
    assert (study.out / "room_curve.png").stat().st_size > 5000


def test_lines_of_other_conditions_are_not_mixed(study, tmp_path):
    study = replace(study, out=tmp_path)
    (tmp_path / "room_curve.jsonl").write_text(json.dumps({"conditions": {"episodes": 5}}) + "\n")
    with pytest.raises(OSError, match=r"other conditions .* choose another --out"):
        room_curve.measure(study)


@pytest.mark.parametrize("seed", [25, 100, 231, 300, 1000])
def test_what_trains_chooses_or_is_sealed_does_not_judge(study, tmp_path, seed):
    with pytest.raises(ValueError, match=f"found --new {seed}, expected seeds of rooms that neith"):
        room_curve.measure(replace(study, out=tmp_path, new=(232, seed)))


def test_some_room_has_to_judge(study, tmp_path):
    with pytest.raises(ValueError, match="found --new without a seed, expected"):
        room_curve.measure(replace(study, out=tmp_path, new=()))
