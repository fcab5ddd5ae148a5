"""Figures of trials over the live graph, from their JSON lines."""

import json

import pytest

from studies.live.live_results import live_results


def write(path, rows, **conditions):
    base = {
        "bundle": path.stem,
        "speed": 2.0,
        "veto": False,
        "lock_step": True,
        "commit": "abc",
    } | conditions
    path.write_text("".join(
        json.dumps({
            "trial": {"room": room, "goal": goal, "seed": 0}, **base, "goal": goal, "room": room,
            "outcome": "done" if success else "step_limit", "success": success,
            "collisions": collisions, "cf_success": success and not collisions, "steps": 10,
            "path_length_m": 4.0, "shortest_path_m": 2.0,
        }) + "\n"
        for room, goal, success, collisions in rows
    ))  # fmt: skip
    return path


def test_two_files_are_compared_on_the_episodes_they_share(tmp_path):
    ours = write(tmp_path / "ours.jsonl", [
        ("kitchen:20", "Fridge", True, 0), ("kitchen:20", "Mug", True, 0),
        ("bedroom:20", "Chair", False, 0), ("bedroom:21", "Chair", True, 0),
    ])  # fmt: skip
    plain = write(tmp_path / "plain.jsonl", [
        ("bedroom:20", "Chair", True, 3), ("kitchen:20", "Mug", True, 0),
        ("kitchen:20", "Fridge", True, 1),
    ])  # fmt: skip
    found = live_results(ours, plain)
    assert found["episodes"] == found["against"]["episodes"] == 3
    assert found["cf_sr"] == pytest.approx(2 / 3)
    assert found["against"]["cf_sr"] == pytest.approx(1 / 3)
    assert found["against"]["sr"] == 1.0
    assert found["against"]["collisions_per_episode"] == pytest.approx(4 / 3)
    assert found["cf_spl"] == pytest.approx(2 / 3 * 0.5)
    assert found["paired"]["cf_sr_difference"] == pytest.approx(1 / 3)
    assert found["outcomes"] == {"done": 2, "step_limit": 1}
    assert live_results(ours)["episodes"] == 4


@pytest.mark.parametrize(
    ("second", "words"),
    [
        (lambda p: write(p, [("kitchen:20", "Fridge", True, 0)], veto=True), "run both alike"),
        (lambda p: write(p, [("kitchen:20", "Mug", True, 0)], bundle="ours"), "no episode in both"),
        (lambda p: write(p, []), "no episodes in"),
    ],
)
def test_what_cannot_be_compared_says_why(tmp_path, second, words):
    ours = write(tmp_path / "ours.jsonl", [("kitchen:20", "Fridge", True, 0)])
    with pytest.raises(ValueError, match=words):
        live_results(ours, second(tmp_path / "plain.jsonl"))


def test_another_camera_is_another_condition(tmp_path):
    rows = [("kitchen:20", "Fridge", True, 0)]
    mast, unsaid = (
        write(tmp_path / "a.jsonl", rows, camera="mast"),
        write(tmp_path / "b.jsonl", rows),
    )
    sold = write(tmp_path / "c.jsonl", rows, camera="stock_preview")
    assert live_results(mast, unsaid)["camera"] == "mast"
    with pytest.raises(ValueError, match="run both alike"):
        live_results(mast, sold)


def test_a_file_of_mixed_trials_is_refused(tmp_path):
    path = write(tmp_path / "ours.jsonl", [("kitchen:20", "Fridge", True, 0)])
    other = write(tmp_path / "other.jsonl", [("kitchen:21", "Fridge", True, 0)], speed=1.0)
    path.write_text(path.read_text() + other.read_text())
    with pytest.raises(ValueError, match="different ways"):
        live_results(path)
