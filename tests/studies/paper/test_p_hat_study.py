"""``python -m studies.paper.p_hat_study`` beside a tiny grid."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from cfnav_core.files.checkpoint import load_tensors
from studies.paper.command import Benchmark
from studies.paper.p_hat_study import PHatStudy, run
from studies.paper.run import run_benchmark
from tests.studies.engine.halls import make_halls
from tests.studies.engine.inline import in_this_process

LISTENING = "runs/*_ours_listening_seed0_*/best.safetensors"


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PHatStudy]:
    folder = tmp_path_factory.mktemp("study")
    make_halls(folder / "rooms")
    grid = Benchmark(
        ("own",), folder / "rooms", folder / "grid", seeds=1, preset="tiny", model=("tdanet",),
        jobs=2, train_only=True, device="cpu",
    )  # fmt: skip
    with in_this_process():
        run_benchmark(grid, "")
        yield PHatStudy(
            grid.scenes, grid.out, folder / "results", seeds=1, episodes=40, jobs=2,
            preset="tiny", model=("tdanet",),
        )  # fmt: skip


def read_page(study: PHatStudy) -> str:
    return (study.results / "p_hat_tdanet.md").read_text()


def test_variants_stand_beside_the_grids_methods(study: PHatStudy) -> None:
    before = {path: path.stat().st_mtime_ns for path in study.grid.glob("runs/*/*")}
    assert before
    run(study, "")
    rows = json.loads((study.results / "p_hat_tdanet.json").read_text())["rows"]
    assert all(row["commit"] for row in rows)
    by = {(row["variant"], row["p_hat"]): row for row in rows}
    assert len(by) == len(rows) == 1 + 3 * 6
    plain, *others = rows
    assert (plain["variant"], plain["over_plain"]) == ("plain", None)
    for row in others:
        scalar = by["ours: one number of the LSTM's input", row["p_hat"]]
        over = None if row is scalar else row["cf_sr_mean"] - scalar["cf_sr_mean"]
        assert row["over_scalar"] == (over if over is None else pytest.approx(over))
        assert row["over_plain"] == pytest.approx(row["cf_sr_mean"] - plain["cf_sr_mean"])
    (best,) = study.grid.glob(LISTENING)
    assert load_tensors(best)[1]["config"]["listening"]
    assert {path: path.stat().st_mtime_ns for path in before} == before
    page = (study.results / "p_hat_tdanet.md").read_text()
    assert page.startswith("40 episodes of each training seed (0).\n")
    assert page.count("\n") == 4 + len(rows)


def test_it_goes_on_without_training_again(study: PHatStudy) -> None:
    run(study, "")
    (best,) = study.grid.glob(LISTENING)
    tests = sorted(study.grid.glob("p_hat/tests/*.npz"))
    assert len(tests) == 1 + 3 * 6
    tests[0].unlink()
    before, page = [p.stat().st_mtime_ns for p in (best, *tests[1:])], read_page(study)
    run(study, "")
    assert [p.stat().st_mtime_ns for p in (best, *tests[1:])] == before
    assert tests[0].exists()
    assert read_page(study) == page


def test_recorded_tests_stand_for_weights_that_are_not_there(
    study: PHatStudy, tmp_path: Path
) -> None:
    run(study, "")
    away = shutil.ignore_patterns("*.safetensors")
    shutil.copytree(study.grid, tmp_path / "grid", ignore=away)
    recorded = replace(study, grid=tmp_path / "grid", results=tmp_path)
    for given in (recorded, replace(recorded, scenes=tmp_path / "none", recorded=True)):
        run(given, "")
        assert read_page(recorded) == read_page(study)
    next((tmp_path / "grid/p_hat/tests").glob("*_other_episode_*.npz")).unlink()
    with pytest.raises(ValueError, match=r"without best\.safetensors, which is to be tested"):
        run(recorded, "")
    nowhere = replace(recorded, scenes=tmp_path / "none", recorded=True)
    with pytest.raises(ValueError, match=r"found no readable results in .*_other_episode_"):
        run(nowhere, "")


@pytest.mark.long
def test_it_asks_the_same_of_longer_training(study: PHatStudy) -> None:
    grid = Benchmark(
        ("tenfold",), study.scenes, study.grid, seeds=1, preset="tiny", model=("tdanet",), jobs=2,
        train_only=True, device="cpu",
    )  # fmt: skip
    run_benchmark(grid, "")
    run(study, "")
    usual = (study.results / "p_hat_tdanet.md").read_text()
    run(replace(study, schedule="tenfold"), "")
    found = json.loads((study.results / "p_hat_tdanet_tenfold.json").read_text())
    assert found["schedule"] == "tenfold"
    assert len(found["rows"]) == 1 + 3 * 6
    (best,) = study.grid.glob("runs/*_ours_listening_tenfold_seed0_*/best.safetensors")
    (other,) = study.grid.glob(LISTENING)
    long, short = (load_tensors(path)[1]["config"] for path in (best, other))
    assert long["listening"]
    episodes = [run["hyperparameters"]["stage2_episodes"] for run in (short, long)]
    assert episodes[1] == 2 * episodes[0]
    assert (study.results / "p_hat_tdanet.md").read_text() == usual


def test_a_model_of_no_study_is_told(study: PHatStudy) -> None:
    with pytest.raises(ValueError, match="found no study of hoz, expected tdanet or lstde"):
        run(replace(study, model=("tdanet", "hoz")), "")


@pytest.mark.parametrize("seeds", [{"seeds": 2}, {"first_seed": 1}])
def test_a_seed_that_no_grid_trained_is_told(study: PHatStudy, seeds: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="found no trained run data2 tdanet plain seed1 in"):
        run(replace(study, **seeds), "")
