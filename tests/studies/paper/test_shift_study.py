"""``python -m studies.paper.shift_study`` on a tiny grid, in halls that look otherwise."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cfnav_core.learn.env import SceneBank
from cfnav_core.learn.evaluate import Episodes, evaluate
from cfnav_core.published.start_states import read_episodes, write_episodes
from cfnav_core.scenes.scene import LIDAR, OfflineScene
from cfnav_core.task.rooms import parse_room, parse_rooms, room_folder
from studies.paper.command import Benchmark
from studies.paper.run import run_benchmark
from studies.paper.shift_study import DRIVERS, ShiftStudy, run
from tests.studies.engine.halls import make_halls
from tests.studies.engine.inline import in_this_process

SHIFT = 0.5
EPISODES = 40


def make_shifted(usual: Path, folder: Path) -> None:
    """The test halls, the LiDAR included, as an eye sees them that is blind to all but noise."""
    rng = np.random.default_rng(0)
    for kind, seed in parse_rooms(["data2:test"]):
        place, old = (room_folder(of, kind, seed) for of in (folder, usual))
        scene = OfflineScene.load(old)
        replace(
            scene, source=f"{scene.source} shifted by {SHIFT}",
            features=rng.normal(size=scene.features.shape).astype(scene.features.dtype),
            detections=np.zeros_like(scene.detections),
        ).save(place)  # fmt: skip
        shutil.copy(old / LIDAR, place)


pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ShiftStudy]:
    folder = tmp_path_factory.mktemp("study")
    make_halls(folder / "rooms")
    make_shifted(folder / "rooms", folder / "shifted")
    bank = SceneBank.load(folder / "rooms", ["data2:test"])
    drawn = Episodes.draw(bank, EPISODES, seed=1).freeze(bank)
    write_episodes(folder / "data2_test.json", drawn, ())
    grid = Benchmark(
        ("tenfold",), folder / "rooms", folder / "grid", seeds=1, preset="tiny",
        model=("tdanet",), jobs=2, device="cpu", episodes=folder, train_only=True,
    )  # fmt: skip
    with in_this_process():
        run_benchmark(grid, "")
        yield ShiftStudy(
            grid.scenes, grid.out, folder / "results", seeds=1, jobs=2, preset="tiny",
            shifted=(folder / "shifted",), episodes=folder,
        )  # fmt: skip


def test_the_same_policies_stand_beside_themselves_in_another_look(study: ShiftStudy) -> None:
    usual, shifted = run(study, "")
    assert (usual.shift, shifted.shift) == (0.0, SHIFT)
    assert list(usual.found) == list(shifted.found) == [
        "TDANet", *(f"ours (TDANet){given}" for given in (
            "", ", zero for p_hat", ", the true flag for p_hat", ", LiDAR for p_hat",
            ", the larger of LiDAR and p_hat",
        )), "TDANet, LiDAR veto", "ours (TDANet), LiDAR veto",
    ]  # fmt: skip
    (best,) = study.grid.glob("runs/*_ours_tenfold_seed0_*/best.safetensors")
    frozen = study.episodes / "data2_test.json"
    for look, scenes in ((usual, study.scenes), (shifted, *study.shifted)):
        driven = evaluate(best, scenes, 0, 0, frozen=frozen).results
        own = look.found["ours (TDANet)"]
        assert own["episodes"] == len(driven) == EPISODES
        assert own["collisions_mean"] == np.mean([result.collisions for result in driven])
        assert own["sr_mean"] == np.mean([result.success for result in driven])
    assert usual.found["ours (TDANet)"] != shifted.found["ours (TDANet)"]
    for look in (usual, shifted):
        own, lidar = look.found["ours (TDANet)"], look.found["ours (TDANet), LiDAR for p_hat"]
        assert lidar["over_own"] == pytest.approx(lidar["cf_sr_mean"] - own["cf_sr_mean"])
        aucs = {quality.source: quality.auc for quality in look.qualities}
        assert aucs["LiDAR"] == 1.0  # the truth, here
    rows = json.loads((study.results / "visual_shift.json").read_text())["rows"]
    assert len(rows) == 2 * len(DRIVERS)
    page = (study.results / "visual_shift.md").read_text()
    assert page.count(f"| | as in training | shift {SHIFT} |") == 6
    assert (study.results / "visual_shift.png").stat().st_size > 10_000


def test_recorded_results_give_the_same_page(study: ShiftStudy, tmp_path: Path) -> None:
    run(study, "")
    away = shutil.ignore_patterns("*.safetensors", "*.steps.npz", "*.lock", "*.log", "*.task.json")
    shutil.copytree(study.grid, tmp_path / "grid", ignore=away)
    nowhere = tmp_path / "none"
    run(replace(
        study, scenes=nowhere, shifted=(), grid=tmp_path / "grid", results=tmp_path,
        recorded=True,
    ), "")  # fmt: skip
    for name in ("visual_shift.md", "visual_shift.png"):
        assert (tmp_path / name).read_bytes() == (study.results / name).read_bytes()
    (tmp_path / "grid" / "looks.json").unlink()
    with pytest.raises(ValueError, match=r"found no looks\.json in .* unpack recorded results"):
        run(replace(study, grid=tmp_path / "grid", recorded=True), "")


def test_other_rooms_are_refused(study: ShiftStudy, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"found rooms shifted by 0\.0 in .* each once"):
        run(replace(study, shifted=(study.scenes,)), "")
    (shifted,) = study.shifted
    shutil.copytree(shifted, tmp_path / "other")
    start = read_episodes(study.episodes / "data2_test.json")[0]
    room = room_folder(tmp_path / "other", *parse_room(start.scene))
    scene = OfflineScene.load(room)
    replace(scene, visible=~scene.visible).save(room)
    with pytest.raises(ValueError, match=r"found another \w+:\d+ in .* make both with"):
        run(replace(study, shifted=(tmp_path / "other",)), "")
