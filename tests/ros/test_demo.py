"""The demo: its plan, its folder, its processes, and one run over the real graph."""

from __future__ import annotations

import itertools
import os
import signal
import sys
import time
from pathlib import Path

import pytest
from cfnav_ros.plan import Trial, chosen_trials, drawn_trials, parse_list
from cfnav_ros.processes import Child, node_command
from cfnav_ros.run_folder import FolderInUseError, RunFolder

GOALS = {"kitchen:25": ("Fridge", "Mug", "Toaster"), "bedroom:23": ("Book", "Mug")}


def test_lists_are_comma_separated() -> None:
    assert parse_list(" Fridge, Mug,,") == ("Fridge", "Mug")
    assert parse_list("") == ()


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


def start(tmp_path: Path, code: str) -> Child:
    command = [sys.executable, "-u", "-c", code]
    return Child("child", command, tmp_path / "child.log", os.environ)


def wait_for(condition: object, deadline_s: float = 20.0) -> None:
    end = time.monotonic() + deadline_s
    while not condition():
        assert time.monotonic() < end, "the condition did not come true in time"
        time.sleep(0.02)


def test_a_child_that_ended_is_named_with_its_last_words_and_its_log(tmp_path: Path) -> None:
    child = start(tmp_path, "print('no such room'); raise SystemExit(2)")
    wait_for(child.ended)
    assert child.ended() == f"child ended with code 2: no such room (log: {tmp_path}/child.log)"
    assert child.stop() == 2


def test_a_child_that_ignores_interrupts_is_still_ended(tmp_path: Path) -> None:
    child = start(
        tmp_path,
        "import signal,time\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\nprint('up')\n"
        "time.sleep(600)",
    )
    wait_for(lambda: "up" in child.log.read_text())
    assert child.ended() is None
    assert child.stop(patience_s=0.3) == -signal.SIGTERM


def test_children_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    parent = start(
        tmp_path,
        "import os,sys,time;from pathlib import Path;from cfnav_ros.processes import Child\n"
        f"child = Child('inner', [sys.executable, '-c', 'import time; time.sleep(600)'], "
        f"Path({str(tmp_path / 'inner.log')!r}), os.environ)\n"
        "print(child.pid, 'is up'); time.sleep(600)",
    )
    wait_for(lambda: "is up" in parent.log.read_text())
    inner = int(parent.log.read_text().split()[0])
    os.kill(parent.pid, signal.SIGKILL)
    parent.stop()
    wait_for(lambda: not _runs(inner))


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except FileNotFoundError:
        return False


def test_installed_executables_come_before_modules(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    assert node_command("cfnav_ros", "policy_node")[1:] == ["-m", "cfnav_ros.policy_node"]
    program = tmp_path / "lib" / "cfnav_ros" / "policy_node"
    program.parent.mkdir(parents=True)
    program.touch(0o755)
    assert node_command("cfnav_ros", "policy_node") == [str(program)]
