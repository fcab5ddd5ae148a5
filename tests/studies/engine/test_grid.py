"""The grid carries out what is missing, in order, and goes on where it stopped."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from cfnav_core.files.locks import locked
from cfnav_core.learn.run_files import BEST, STAGE1
from studies.engine.episodes import RunTest
from studies.engine.grid import GridError, Process, run_tasks
from studies.engine.jobs import GridFolders, Job
from studies.engine.work import Task

OURS = Job("lstde", "ours", "data1", 0, "tiny", "p")


class Recorded:
    """An executor whose tasks end at the first look, in a way that it says."""

    def __init__(self, slots: int = 2, fails: str = "") -> None:
        self.slots, self.fails = slots, fails
        self.begun: list[Task] = []
        self.most = 0
        self.running = 0

    def start(self, task: Path, log: Path) -> Process:
        read = Task.load(task)
        self.begun.append(read)
        self.running += 1
        self.most = max(self.most, self.running)
        return Begun(self, read)


class Begun:
    """A task that was started, see ``grid.Process``."""

    def __init__(self, executor: Recorded, task: Task) -> None:
        self.executor, self.task = executor, task
        self.told = self.waited = False

    def poll(self) -> int:
        self.executor.running -= 1
        if self.task.job.method == self.executor.fails:
            return 2
        (self.task.folder / STAGE1).touch()
        self.task.result.touch()
        return 0

    def terminate(self) -> None:
        self.told = True

    def wait(self) -> int:
        self.waited = True
        return 130


@pytest.fixture
def places(tmp_path: Path) -> GridFolders:
    return GridFolders(tmp_path / "rooms", tmp_path / "grid")


def of(places: GridFolders, *methods: str) -> list[Task]:
    return [Task(replace(OURS, method=method), places) for method in methods]


def test_tasks_wait_for_the_stage_one_that_they_go_on_from(places: GridFolders) -> None:
    executor = Recorded()
    run_tasks(of(places, "plain", "reward", "ours", "stage_only"), executor)
    begun = [task.job.method for task in executor.begun]
    assert begun[:2] == ["reward", "ours"]
    assert sorted(begun[2:]) == ["plain", "stage_only"]
    assert executor.most == 2


def test_what_is_done_is_not_done_again(places: GridFolders) -> None:
    tasks = of(places, "ours", "plain")
    run_tasks(tasks, Recorded())
    again = Recorded()
    run_tasks(tasks, again)
    assert again.begun == []


def test_results_without_the_weights_to_go_on_from_are_told(places: GridFolders) -> None:
    tasks = of(places, "ours", "plain", "reward")
    run_tasks(tasks[:1], Recorded())
    (tasks[0].folder / STAGE1).unlink()
    executor = Recorded()
    with pytest.raises(GridError, match=r"without stage1.* from which data1 lstde plain seed0"):
        run_tasks(tasks, executor)
    assert executor.begun == []


def test_what_cannot_be_tested_is_told(places: GridFolders) -> None:
    (run,) = of(places, "ours")
    test = replace(run, test=RunTest("own", False, Path("frozen.json"), 5, "aaaa"))
    executor = Recorded()
    with pytest.raises(GridError, match=r"found no trained run data1 lstde ours seed0 in .*first"):
        run_tasks([test], executor)
    run_tasks([run], executor)
    (run.folder / BEST).unlink(missing_ok=True)
    with pytest.raises(GridError, match=f"with results but without {BEST}, which is to be tested"):
        run_tasks([test], executor)
    assert executor.begun == [run]


def test_a_failure_is_told_and_the_rest_is_done(places: GridFolders) -> None:
    executor = Recorded(fails="ours")
    with pytest.raises(GridError, match="1 tasks failed and 1 wait for such, the first is data1"):
        run_tasks(of(places, "ours", "plain", "reward"), executor)
    assert {task.job.method for task in executor.begun} == {"ours", "reward"}


def test_a_task_survives_its_file(places: GridFolders) -> None:
    train = Task(OURS, places, None, "cpu", "medium")
    train.folder.mkdir(parents=True)
    assert Task.load(train.save()) == train
    test = Task(
        OURS, places, RunTest("other_episode", True, Path("docs/data1_test.json"), 40, "abc")
    )
    assert Task.load(test.save()) == test
    assert test.result.name == "data1_test_40_other_episode_veto_abc.npz"
    assert not test.ready
    train.result.touch()
    assert test.ready


def test_two_processes_never_do_one_task(tmp_path: Path) -> None:
    again = pytest.raises(OSError, match=r"found .*done\.lock held by another process")
    with locked(tmp_path / "done.lock"), again, locked(tmp_path / "done.lock"):
        pass
    with locked(tmp_path / "done.lock"):
        pass


def test_what_runs_is_told_to_end_with_the_grid(places: GridFolders) -> None:
    begun: list[Begun] = []

    class Stopped(Recorded):
        def start(self, task: Path, log: Path) -> Process:
            if begun:
                raise KeyboardInterrupt
            begun.append(Begun(self, Task.load(task)))
            return begun[0]

    with pytest.raises(KeyboardInterrupt):
        run_tasks(of(places, "ours", "reward"), Stopped())
    assert (begun[0].told, begun[0].waited) == (True, True)
