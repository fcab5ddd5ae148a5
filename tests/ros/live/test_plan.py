"""The plan of a run and the folder of its results."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from cfnav_ros.live.plan import Trial, chosen_trials, drawn_trials, parse_list
from cfnav_ros.live.run_folder import FolderInUseError, RunFolder
from cfnav_ros.process.graph_config import GraphConfig

from cfnav_core.files.json_lines import read_rows

GOALS = {"kitchen:25": ("Fridge", "Mug", "Toaster"), "bedroom:23": ("Book", "Mug")}


def test_lists_are_comma_separated() -> None:
    assert parse_list(" Fridge, Mug,,") == ("Fridge", "Mug")
    assert parse_list("") == ()


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (None, {}),
        (0.0, {"depth": True, "depth_down_deg": 0.0}),
        (65.0, {"depth": True, "depth_down_deg": 65.0}),
    ],
)
def test_the_mock_has_the_depth_camera_that_is_asked_for(
    asked: float | None, told: dict[str, float], tmp_path: Path
) -> None:
    mock = GraphConfig("kitchen:25", tmp_path, depth_down_deg=asked).parts[0]
    assert mock.executable == "mock_turtlebot4"
    assert {k: v for k, v in mock.parameters.items() if k.startswith("depth")} == told


def test_chosen_goals_are_sought_where_they_are_and_repeated_with_new_seeds() -> None:
    trials = list(itertools.islice(chosen_trials(GOALS, ("Mug", "Book"), 5), 4))
    assert trials == [
        Trial("kitchen:25", "Mug", 5),
        Trial("bedroom:23", "Mug", 5),
        Trial("bedroom:23", "Book", 5),
        Trial("kitchen:25", "Mug", 6),
    ]


def test_a_goal_that_no_room_has_is_refused_with_what_there_is() -> None:
    with pytest.raises(ValueError, match="'Sofa' is in none of the rooms: kitchen:25 has Fridge"):
        chosen_trials(GOALS, ("Mug", "Sofa"), 1)


def test_drawn_trials_repeat_for_a_seed_and_cover_every_goal() -> None:
    first, again, other = (list(itertools.islice(drawn_trials(GOALS, s), 12)) for s in (3, 3, 4))
    assert first == again
    assert first != other
    assert {(t.room, t.goal) for t in first} == {(r, g) for r, has in GOALS.items() for g in has}
    assert len(set(first)) == 12


def test_results_have_their_name_only_when_finished(tmp_path: Path) -> None:
    out = tmp_path / "demo"
    for text in ("first", "second"):
        with RunFolder(out) as folder:
            (folder.partial / "metrics.json").write_text(text)
            assert not out.exists() or (out / "metrics.json").read_text() == "first"
            folder.finish()
        assert (out / "metrics.json").read_text() == text
    assert [p.name for p in tmp_path.iterdir()] == ["demo"]


def test_what_an_interrupted_run_left_is_not_taken_for_good(tmp_path: Path) -> None:
    with RunFolder(tmp_path / "demo") as folder:
        (folder.partial / "metrics.json").write_text("half")
    assert not (tmp_path / "demo").exists()
    with RunFolder(tmp_path / "demo") as folder:
        assert list(folder.partial.iterdir()) == []


def test_two_runs_do_not_share_a_folder(tmp_path: Path) -> None:
    with (
        RunFolder(tmp_path / "demo"),
        pytest.raises(FolderInUseError, match="another run"),
        RunFolder(tmp_path / "demo"),
    ):
        pass


def test_rows_of_an_interrupted_trial_are_read_without_the_one_cut_short(tmp_path: Path) -> None:
    path = tmp_path / "trials.jsonl"
    assert read_rows(path) == []
    path.write_text('{"steps": 3}\n{"steps": 4}\n{"ste')
    assert read_rows(path) == [{"steps": 3}, {"steps": 4}]
    path.write_text('{"steps": 3}\n{"ste\n{"steps": 4}\n5\n')
    with pytest.raises(OSError, match=r"2 of 4 lines of .* damaged \(line 2, 4\); remove them"):
        read_rows(path)
