"""``cfnav benchmark`` from scenes to tables and figures, with small scenes and hardly any training.

The grid runs in this process; then parts of it on a local Ray cluster of two workers, and in
processes of their own.
"""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cfnav_core.agent.agent import new_agent
from cfnav_core.files.locks import locked
from cfnav_core.knowledge.files import load_knowledge
from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Episodes
from cfnav_core.published.start_states import read_episodes, write_episodes
from cfnav_core.scenes.scene import LIDAR, SCENE, SceneError
from cfnav_core.task.p_hat import TESTED
from cfnav_core.task.rooms import parse_room, room_folder
from studies.engine.presets import PRESETS
from studies.engine.stamps import Made
from studies.paper.command import Benchmark
from studies.paper.run import run_benchmark
from tests.conftest import DEADLINE_S, wait_until
from tests.studies.engine.halls import make_halls
from tests.studies.engine.inline import in_this_process

TABLES = ("I", "own")
OF = "data2_mjolnir_{}_seed0_*"


@pytest.fixture(scope="module")
def options(tmp_path_factory: pytest.TempPathFactory) -> Benchmark:
    """The rooms of data2, each a small hall, and episodes in those that test."""
    folder = tmp_path_factory.mktemp("benchmark")
    scenes, episodes = folder / "rooms", folder / "episodes"
    make_halls(scenes)
    bank = SceneBank.load(scenes, ["data2:test"])
    write_episodes(episodes / "data2_test.json", Episodes.draw(bank, 60, seed=1).freeze(bank), ())
    return Benchmark(
        TABLES, scenes, folder / "grid", seeds=1, preset="tiny", model=("mjolnir",), jobs=2,
        device="cpu", episodes=episodes,
    )  # fmt: skip


@pytest.fixture(scope="module")
def found(options: Benchmark) -> dict[str, dict[str, object]]:
    """Rows of the summary by name."""
    with in_this_process():
        run_benchmark(options, "cfnav benchmark I own")
    return rows_of(options)


def rows_of(options: Benchmark) -> dict[str, dict[str, object]]:
    rows = json.loads((options.out / "summary.json").read_text())["rows"]
    return {row["row"]: row for row in rows}


def test_every_row_is_there_with_what_the_paper_says(options: Benchmark, found) -> None:
    assert list(found)[:2] == ["MJOLNIR-r", "ours (MJOLNIR-r)"]
    ours = found["ours (MJOLNIR-r)"]
    assert (ours["paper_cf_sr"], ours["paper_cf_spl"], ours["paper_gain"]) == (0.558, 0.21, 0.086)
    assert (ours["table"], ours["split"], ours["method"]) == ("I", "data2", "ours")
    assert (ours["seeds"], ours["episodes"]) == (1, 40)
    assert len(str(ours["config_hash"])) == 12
    assert ours["command"] == "cfnav benchmark I own"
    own = [row for row in found.values() if row["table"] == "own"]
    assert {row["p_hat"] for row in own} == set(TESTED)
    drawn = found["ours (MJOLNIR-r), actions drawn"]
    assert drawn["sample"]
    assert drawn["collisions_mean"] != ours["collisions_mean"]
    assert 0 < float(str(ours["long_episodes"])) < 40
    assert ours["gain_by_seed"] == [ours["gain"]]
    veto = found["MJOLNIR-r, LiDAR veto"]
    difference = float(str(ours["cf_sr_mean"])) - float(str(veto["cf_sr_mean"]))
    assert veto["ours_over"] == pytest.approx(difference, abs=2e-4)
    both = found["ours (MJOLNIR-r), LiDAR veto"]
    difference = float(str(both["cf_sr_mean"])) - float(str(veto["cf_sr_mean"]))
    assert both["over_vetoed"] == pytest.approx(difference, abs=2e-4)
    assert veto["over_vetoed"] is ours["over_vetoed"] is None
    with np.load(next(options.out.glob(f"runs/{OF.format('ours')}/*_own_drawn_*.npz"))) as file:
        assert drawn["touched_mean"] == pytest.approx((file["collisions"] > 0).mean(), abs=1e-4)
    assert found["random"]["gain"] is None
    assert 0 <= float(str(found["random"]["sr_mean"])) < 0.3


def test_csv_and_pages_say_the_same(options: Benchmark, found) -> None:
    with (options.out / "summary.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [row["row"] for row in table] == list(found)
    assert float(table[1]["cf_sr_mean"]) == found["ours (MJOLNIR-r)"]["cf_sr_mean"]
    page = (options.out / "table_I.md").read_text()
    assert "| data2 | ours (MJOLNIR-r) | 55.8 ± 5.0 |" in page
    ours = found["ours (MJOLNIR-r)"]
    gain, long = (100 * float(str(ours[of])) for of in ("gain", "long_gain"))
    assert (
        f"on data2, 1 model (seeds: 1, tiny): {gain:+.1f} points, {long:+.1f} over episodes whose "
        "shortest way is five actions or more; the paper's of the same models: +8.6." in page
    )
    below = page.split("given another probability")[1]
    assert below.count("| data2 | ours (MJOLNIR-r), ") == 3
    assert "| data2 | ours (MJOLNIR-r), the true flag for p_hat |" in below


def test_the_grids_knowledge_serves_every_model(options: Benchmark, found) -> None:
    bank = SceneBank.load(options.scenes, ["kitchen:20"])
    path = options.out / "knowledge_data2.safetensors"
    knowledge = load_knowledge(path, bank.objects, bank.perception)
    for model, run in PRESETS["tiny"].runs.items():
        agent = new_agent(replace(run, model=model), bank.inputs, knowledge)
        assert sum(p.numel() for p in agent.model.parameters()) > 0


def test_what_training_took_is_kept(options: Benchmark, found) -> None:
    with (options.out / "runs.csv").open() as file:
        ours, plain = csv.DictReader(file)
    assert (ours["method"], plain["method"]) == ("ours", "plain")
    assert ours["config_hash"] == found["ours (MJOLNIR-r)"]["config_hash"]
    assert int(ours["episodes"]) >= 400
    assert float(ours["cpu_s"]) > 0
    assert 0 <= float(ours["validation_cf_sr"]) <= 1


def test_probabilities_are_judged_where_ours_drove(options: Benchmark, found) -> None:
    rgb, lidar, larger = json.loads((options.out / "predictor.json").read_text())
    assert (rgb["source"], lidar["source"]) == ("RGB predictor", "LiDAR")
    assert (larger["source"], larger["steps"]) == ("the larger", rgb["steps"])
    assert rgb["skill"] < larger["skill"] < lidar["skill"]
    assert rgb["steps"] == lidar["steps"] >= 40
    assert (lidar["auc"], lidar["ece"], lidar["skill"]) == (1.0, 0.0, 1.0)  # the truth, here
    assert rgb["skill"] < 1
    assert (
        "| data2 | MJOLNIR-r, tiny | LiDAR | 1.000 |" in (options.out / "predictor.md").read_text()
    )


def test_stage_one_was_trained_once(options: Benchmark, found) -> None:
    (ours,) = (options.out / "runs").glob(OF.format("ours"))
    (plain,) = (options.out / "runs").glob(OF.format("plain"))
    assert (ours / "stage1.safetensors").exists()
    assert not (plain / "stage1.safetensors").exists()


@pytest.mark.long
def test_a_ray_cluster_of_two_workers_makes_the_same_rows(
    options: Benchmark, found, tmp_path
) -> None:
    run_benchmark(
        replace(options, tables=("I",), out=tmp_path, ray="local"), "cfnav benchmark I own"
    )
    of_paper = {name: row for name, row in found.items() if row["table"] == "I"}
    assert rows_of(replace(options, out=tmp_path)) == of_paper


def test_going_on_does_what_is_missing_and_nothing_else(options: Benchmark, found) -> None:
    (ours,) = (options.out / "runs").glob(OF.format("ours"))
    (plain,) = (options.out / "runs").glob(OF.format("plain"))
    removed = next(plain.glob("*_own_*.npz"))
    removed.unlink()
    kept = {path: path.stat().st_mtime_ns for path in ours.iterdir()}
    run_benchmark(options, "cfnav benchmark I own")
    assert removed.exists()
    assert {path: path.stat().st_mtime_ns for path in ours.iterdir()} == kept
    assert rows_of(options) == found


def test_rows_that_need_the_lidar_say_so_before_training(options: Benchmark, tmp_path) -> None:
    start = read_episodes(options.episodes / "data2_test.json")[0]
    first = room_folder(options.scenes, *parse_room(start.scene))
    away = (first / LIDAR).rename(tmp_path / LIDAR)
    try:
        with pytest.raises(SceneError, match="found no readable lidar"):
            run_benchmark(replace(options, out=tmp_path / "grid"), "")
    finally:
        away.rename(first / LIDAR)
    assert not (tmp_path / "grid" / "runs").exists()


def test_runs_of_other_rooms_are_not_gone_on_with(options: Benchmark, found) -> None:
    head = room_folder(options.scenes, "kitchen", 0) / SCENE
    before = head.read_text()
    head.write_text(before.replace('"collided": "', '"collided": "0'))
    try:
        with pytest.raises(ValueError, match=r"are not those in which the runs .* give another"):
            run_benchmark(options, "")
    finally:
        head.write_text(before)


def test_missing_rooms_are_told_in_a_sentence(options: Benchmark, tmp_path) -> None:
    with pytest.raises(SceneError, match=r"found no readable scene in .* make it again"):
        run_benchmark(replace(options, scenes=tmp_path / "none", out=tmp_path / "grid"), "")


def test_tests_of_other_episodes_rooms_or_lidar_do_not_count(options: Benchmark, found) -> None:
    frozen = options.episodes / "data2_test.json"
    room = room_folder(options.scenes, *parse_room(read_episodes(frozen)[0].scene))

    def made() -> tuple[str, str]:
        tests = Made.of(options.scenes, {"data2": frozen}, {"data2"}).tests
        return tests["data2"], tests[f"data2 {LIDAR}"]

    first = made()
    assert made() == first
    both, one, neither = (True, True), (False, True), (False, False)
    head = json.loads((room / SCENE).read_text())
    sums = head["sha256"]
    for path, new, changes in (
        (frozen, frozen.read_bytes() + b" ", both),
        (room / LIDAR, (room / LIDAR).read_bytes() + b" ", one),
        (room / SCENE, with_head(head, source="another"), neither),
        (room / SCENE, with_head(head, source="rooms 1 shifted by 0.5"), both),
        (room / SCENE, with_head(head, goals=["Mug"]), both),
        (room / SCENE, with_head(head, sha256=sums | {"collided": "0"}), both),
        (room / SCENE, with_head(head, sha256=sums | {"features": "0"}), neither),
    ):
        content = path.read_bytes()
        path.write_bytes(new)
        assert tuple(a != b for a, b in zip(made(), first, strict=True)) == changes
        path.write_bytes(content)
    assert made() == first


def test_tests_of_other_splits_stay_noted(tmp_path) -> None:
    both = {"data1": "a", f"data1 {LIDAR}": "b", "data2": "c", f"data2 {LIDAR}": "d"}
    Made("eyes", both).write(tmp_path)
    Made("eyes", {"data2": "e"}).write(tmp_path)
    assert Made.read(tmp_path).tests == {"data1": "a", f"data1 {LIDAR}": "b", "data2": "e"}
    Made("others", {"data2": "f"}).write(tmp_path)
    assert Made.read(tmp_path) == Made("others", {"data2": "f"})


def with_head(head: dict[str, object], **changes: object) -> bytes:
    return json.dumps(head | changes).encode()


def test_recorded_results_give_the_same_tables(options: Benchmark, found, tmp_path) -> None:
    """Without weights, and from the records alone also without rooms."""
    away = shutil.ignore_patterns("*.safetensors", "*.steps.npz", "*.lock", "*.log", "*.task.json")
    copy = tmp_path / "grid"
    shutil.copytree(options.out / "runs", copy / "runs", ignore=away)
    for kept in (*options.out.glob("random_*.npz"), options.out / "rooms.json"):
        shutil.copy(kept, copy)
    shutil.copy(options.out / "tests.json", copy)
    again = replace(options, out=copy)
    nowhere = tmp_path / "none"
    alone = replace(again, recorded=True, scenes=nowhere, episodes=nowhere, results=copy / "alone")
    for given in (again, alone):
        run_benchmark(given, "cfnav benchmark I own")
        results = given.results or copy
        assert rows_of(replace(options, out=results)) == found
        for name in ("runs.csv", "predictor.json", "table_I.md"):
            assert (results / name).read_text() == (options.out / name).read_text()
    assert not list(copy.glob("runs/*/*.safetensors"))
    log = next(copy.glob("runs/*_plain_*/log.jsonl"))
    kept = log.rename(tmp_path / "log")
    with pytest.raises(ValueError, match=r"found no log\.jsonl in .* archive of seed 0"):
        run_benchmark(replace(alone, results=tmp_path / "unwritten"), "")
    assert not (tmp_path / "unwritten").exists()
    kept.rename(log)
    next(copy.glob("runs/*ours*/*_own_*.npz")).unlink()
    with pytest.raises(ValueError, match="found no readable results in"):
        run_benchmark(alone, "")
    with pytest.raises(ValueError, match=r"found no readable tests\.json in .* unpack recorded"):
        run_benchmark(replace(alone, out=tmp_path / "other"), "")


@pytest.mark.long
def test_tenfold_goes_on_from_the_usual_stage_one_to_a_table_of_its_own(
    options: Benchmark, found, tmp_path
) -> None:
    tenfold = replace(options, tables=("tenfold",), model=("tdanet",))
    run_benchmark(tenfold, "cfnav benchmark tenfold")
    rows = json.loads((options.out / "summary.json").read_text())["rows"]
    assert {row["row"]: row for row in rows if row["table"] != "tenfold"} == found
    mine = {row["row"]: row for row in rows if row["table"] == "tenfold"}
    assert {row["method"] for row in mine.values()} == {
        "plain", "reward_only", "stage_only", "ours", "truth",
    }  # fmt: skip
    assert mine["ours (TDANet), actions drawn"]["sample"]
    runs = options.out / "runs"
    for method in ("plain", "ours", "reward_only"):
        (run,) = runs.glob(f"data2_tdanet_{method}_tenfold_seed0_*")
        assert not (run / "stage1.safetensors").exists()
        last = json.loads((run / "log.jsonl").read_text().splitlines()[-1])
        assert last["episodes"] >= 600
    assert (options.out / "curves_tenfold_tdanet.png").exists()
    assert "| Truth (TDANet) |" in (options.out / "curves_tenfold_tdanet.md").read_text()
    judged = [q["model"] for q in json.loads((options.out / "predictor.json").read_text())]
    assert judged[-3:] == ["TDANet, tenfold, tiny"] * 3
    again = replace(tenfold, recorded=True, results=tmp_path)
    run_benchmark(again, "cfnav benchmark tenfold")
    table = "table_tenfold.md"
    assert (tmp_path / table).read_text() == (options.out / table).read_text()


def test_a_grid_that_is_told_to_stop_leaves_nothing_behind(options: Benchmark, tmp_path) -> None:
    grid = subprocess.Popen(
        [sys.executable, "-m", "cfnav.cli", "benchmark", "I", "--model", "tdanet",
         "--preset", "small", "--seeds", "1", "--jobs", "1", "--scenes", str(options.scenes),
         "--out", str(tmp_path), "--train-only"],
        stderr=subprocess.PIPE,
    )  # fmt: skip

    def logs() -> list[Path]:
        return list(tmp_path.glob("runs/*/log.jsonl"))

    wait_until(lambda: logs() or grid.poll() is not None, "the log of a run")
    assert grid.poll() is None, grid.communicate()[1].decode()
    (log,) = logs()
    grid.terminate()
    assert grid.wait(DEADLINE_S) == 130
    with locked(log.parent / "done.lock"):
        pass
    assert (log.parent / "checkpoint.safetensors").exists()
