"""Table IV: its trials, its rooms, its figures, and the real graph from bundles to the table."""

from __future__ import annotations

import json
import os
import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from sim_bridge.room.room import generate_room, parse_room
from sim_bridge.world.camera import Camera
from sim_bridge.world.grid import start_episode
from sim_bridge.world.world import World

from cfnav_core.files.checkpoint import load_tensors, save_tensors
from cfnav_core.files.json_lines import append_row
from cfnav_core.learn.export import export_bundle
from cfnav_core.policy.bundle import BundleError, shipped_perception
from cfnav_core.task.actions import Action
from studies.deploy.bundles import make_bundle
from studies.engine.jobs import Job
from studies.live.drive import run_of
from studies.live.identities import WORLD, identity_of
from studies.live.table_iv import TableIV, run
from studies.live.table_iv_rows import (
    ALL,
    GOALS,
    PAPERS,
    PLACES,
    ROOMS,
    SOURCES,
    key_of,
    trials_of,
)  # fmt: skip
from tests.core.model_samples import save_fresh

METHODS = [way.method for way in PAPERS]


def test_fifteen_trials_are_five_in_each_room() -> None:
    trials = trials_of(15, seed=0)
    assert set(Counter(t.room for t in trials).values()) == {5}
    assert [Counter(t.goal for t in trials)[goal] for goal in GOALS] == [6, 6, 3]
    others = [*trials_of(15, seed=1), *(t for n in range(5) for t in trials_of(20, n))]
    assert len({t.seed for t in [*trials, *others]}) == 15 + 15 + 100


@pytest.mark.parametrize("name", ROOMS)
def test_rooms_hold_every_goal_and_as_much_furniture_as_stated(name: str) -> None:
    world = World(generate_room(*parse_room(name)))
    assert (world.occupancy() > 0).mean() == pytest.approx(ROOMS[name], abs=5e-4)
    for goal in GOALS:
        boxes = np.array([o.footprint for o in world.room.objects if o.name == goal])
        centres = (boxes[:, :2] + boxes[:, 2:]) / 2
        assert np.array(PLACES[name][goal]) == pytest.approx(centres, abs=0.01)
    with Camera(world) as camera:
        for goal in GOALS:
            assert start_episode(world, camera, goal, 1000).shortest_actions > 5


@pytest.fixture
def bundles(tmp_path: Path) -> Path:
    """Four methods; all look around and say Done."""
    folder = tmp_path / "bundles"
    for method in METHODS:
        put_bundle(folder / f"{method}_seed0", [Action.RotateLeft, Action.MoveAhead, Action.Done])
    return folder


def put_bundle(place: Path, actions: list[Action]) -> None:
    shutil.rmtree(place, ignore_errors=True)
    made = make_bundle(place.parent / "made", dict.fromkeys(GOALS, actions))
    shutil.copytree(made, place)


def put_maps(out: Path) -> None:
    (out / "maps").mkdir(parents=True)
    for room in ROOMS:
        name = out / "maps" / f"{room.replace(':', '_')}.npz"
        np.savez(name, occupied=np.eye(100, dtype=bool), resolution=0.05)


def _driven(path: Path, config: TableIV, method: str, successes: int, seed: int = 0) -> None:
    """Write down fifteen trials as if they had been driven."""
    bundle = config.bundles / f"{method}_seed{seed}"
    said = {"bundle": identity_of(bundle), "run": run_of(bundle), "commit": "abc"}
    said["world"] = WORLD
    for n, trial in enumerate(trials_of(15, seed)):
        good = n < successes
        outcome = "done" if good or n % 2 else "aborted"
        append_row(path, {
            "trial": trial.__dict__, **said, "goal": trial.goal,
            "room": trial.room, "outcome": outcome, "success": good, "collisions": int(not good),
            "cf_success": good, "steps": 9, "path_length_m": 4.0, "shortest_path_m": 2.0,
            "track": [(1.0, 1.0, 0), (2.0, 1.5, int(not good))],
        })  # fmt: skip


def test_figures_are_those_of_what_was_driven(bundles: Path, tmp_path: Path) -> None:
    config = TableIV(bundles=bundles, rows="paper", out=tmp_path / "out")
    put_maps(config.out)
    for method, successes in zip(METHODS, (3, 6, 9, 12), strict=True):
        _driven(config.out / f"{method}_seed0_15.jsonl", config, method, successes)
    run(config, "")
    rows = json.loads((config.out / "summary.json").read_text())["rows"]
    assert [row["cf_sr_mean"] for row in rows] == [0.2, 0.4, 0.6, 0.8]
    assert [row["paper_cf_sr"] for row in rows] == [0.0, 0.067, 0.267, 0.8]
    assert [row["gain"] for row in rows] == [None, *(pytest.approx(x) for x in (0.2, 0.4, 0.6))]
    assert rows[3]["cf_spl_mean"] == pytest.approx(0.4)
    assert rows[3]["row"] == "ours (TDANet)"
    assert rows[0]["collisions_mean"] == rows[0]["touched_mean"] == pytest.approx(0.8)
    assert rows[0]["aborted_mean"] == pytest.approx(6 / 15, abs=1e-3)
    over = [row["ours_over"] for row in rows]
    assert over == [None, pytest.approx(0.4), pytest.approx(0.2), None]
    with Image.open(config.out / "table_IV_15.png") as picture:
        assert min(picture.size) > 800
    # policies of another training stand beside them
    tenfold = replace(config, schedule="tenfold")
    for method, successes in zip(METHODS, (1, 2, 3, 4), strict=True):
        shutil.copytree(bundles / f"{method}_seed0", bundles / f"{method}_tenfold_seed0")
        _driven(config.out / f"{method}_tenfold_seed0_15.jsonl", tenfold, method, successes)
    run(tenfold, "")
    both = json.loads((config.out / "summary.json").read_text())["rows"]
    assert [row for row in both if row in rows] == rows
    assert [row["cf_sr_mean"] for row in both if row["split"] == "15 live trials, tenfold"] == [
        pytest.approx(n / 15, abs=1e-3) for n in (1, 2, 3, 4)
    ]
    assert (config.out / "table_IV_15_tenfold.png").exists()
    # trials are paired by what they are, not by where they stand
    path = config.out / "ours_seed0_15.jsonl"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines[5:], *lines[:5]]) + '{"trial": {"ro')
    run(config, "")
    again = json.loads((config.out / "summary.json").read_text())["rows"]
    assert again == both
    # what was driven says all that the table needs
    shutil.rmtree(bundles)
    run(config, "")
    assert json.loads((config.out / "summary.json").read_text())["rows"] == both
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines).replace(WORLD, "older"))
    with pytest.raises(OSError, match="found trials in 2 versions of the simulator"):
        run(config, "")
    path.unlink()
    with pytest.raises(BundleError, match="ours_seed0"):
        run(config, "")


def test_a_bundle_of_another_training_is_refused(bundles: Path, tmp_path: Path) -> None:
    job = Job("tdanet", "plain", "data2", 0, "small", "eyes")
    head = bundles / "plain_seed0" / "bundle.json"
    about = json.loads(head.read_text())
    about["training"] = {
        "config": asdict(job.config), "train_rooms": ["data2:train"], "perception": "eyes",
    }  # fmt: skip
    head.write_text(json.dumps(about))
    for method, schedule in (("plain", "tenfold"), ("stage_only", "usual")):
        config = TableIV(bundles, schedule, rows="paper", out=tmp_path)
        name = method + ("_tenfold" if schedule == "tenfold" else "")
        shutil.rmtree(bundles / f"{name}_seed0", ignore_errors=True)
        shutil.copytree(bundles / "plain_seed0", bundles / f"{name}_seed0")
        with pytest.raises(BundleError, match=f"found the bundle of {job.title} in .*{name}_seed0"):
            run(replace(config, only=(method,)), "")
    config = TableIV(bundles, rows="paper", out=tmp_path, only=("plain",))
    for other in (replace(job, model="lstde", split="data1"), replace(job, variant="listening")):
        about["training"] |= {
            "config": asdict(other.config), "train_rooms": [f"{other.split}:train"],
        }  # fmt: skip
        head.write_text(json.dumps(about))
        with pytest.raises(BundleError, match=f"{other.title} in .*, expected {job.title}; export"):
            run(config, "")


def test_seeds_share_the_trials(bundles: Path, tmp_path: Path) -> None:
    config = TableIV(bundles=bundles, rows="paper", out=tmp_path / "out", trials=30, seeds=2)
    put_maps(config.out)
    for method, found in zip(METHODS, ((3, 6), (3, 3), (6, 9), (9, 15)), strict=True):
        shutil.copytree(bundles / f"{method}_seed0", bundles / f"{method}_seed1")
        for seed, successes in enumerate(found):
            path = config.out / f"{method}_seed{seed}_15.jsonl"
            _driven(path, config, method, successes, seed)
    run(config, "")
    rows = json.loads((config.out / "summary.json").read_text())["rows"]
    assert [(row["seeds"], row["episodes"]) for row in rows] == [(2, 15)] * 4
    assert [row["cf_sr_mean"] for row in rows] == [pytest.approx(x) for x in (0.3, 0.2, 0.5, 0.8)]
    assert rows[3]["cf_sr_std"] == pytest.approx(np.std([0.6, 1.0], ddof=1))
    assert rows[3]["gain_by_seed"] == [pytest.approx(0.4), pytest.approx(0.6)]
    assert rows[3]["gain"] == pytest.approx(0.5)
    assert (config.out / "table_IV_30.png").exists()


def test_later_seeds_stand_beside_the_first(bundles: Path, tmp_path: Path) -> None:
    shutil.copytree(bundles / "plain_seed0", bundles / "plain_seed4")
    shutil.copytree(bundles / "ours_seed0", bundles / "ours_seed4")
    config = TableIV(bundles, rows="sources", out=tmp_path / "out", first_seed=4)
    put_maps(config.out)
    for way, successes in zip(SOURCES, (3, 6, 9, 12), strict=True):
        _driven(config.out / f"{key_of(way)}_seed4_15.jsonl", config, way.method, successes, 4)
    run(config, "")
    plain, lidar, own, both = json.loads((config.out / "summary.json").read_text())["rows"]
    assert plain["split"] == both["split"] == "15 live trials, from seed 4"
    assert [row["cf_sr_mean"] for row in (plain, own, both)] == [0.2, 0.6, 0.8]
    assert lidar["over_own"] == pytest.approx(-0.2)
    assert both["over_own"] == pytest.approx(0.2)
    assert (config.out / "table_IV_15_sources_from_seed4.png").exists()


def test_drawn_rows_gain_over_drawn_plain(bundles: Path, tmp_path: Path) -> None:
    shutil.copytree(bundles / "ours_seed0", bundles / "truth_seed0")
    config = TableIV(bundles=bundles, rows="all", out=tmp_path / "out")
    put_maps(config.out)
    for n, way in enumerate(ALL):
        _driven(config.out / f"{key_of(way)}_seed0_15.jsonl", config, way.method, 4 * n % 15)
    run(config, "")
    found = json.loads((config.out / "summary.json").read_text())["rows"]
    rows = {row["row"]: row for row in found}
    assert len(rows) == len(ALL)
    plain, drawn = rows["TDANet"], rows["TDANet, actions drawn"]
    assert plain["gain"] is drawn["gain"] is None
    for row in found:
        if row["method"] != "plain":
            light = ", no visual shift" if row["row"].endswith("shift") else ""
            reference = drawn if row["sample"] else rows[f"TDANet{light}"]
            gain = row["cf_sr_mean"] - reference["cf_sr_mean"]
            assert row["gain"] == pytest.approx(gain, abs=1e-3)
    assert sum(row["sample"] for row in found) == 4
    assert rows["ours (TDANet)"]["over_own"] == pytest.approx((12 - 1) / 15, abs=1e-3)
    assert rows["ours (TDANet), actions drawn"]["over_own"] is None
    alike = [row for row in found if row["gain"] == 0]
    assert alike
    assert all(row["gain_ci95"] is None for row in alike)


def test_bundles_of_one_network_are_told_apart_by_their_weights(tmp_path: Path) -> None:
    perception = shipped_perception()
    checkpoint = save_fresh(tmp_path / "best.safetensors", "tdanet", perception, ("Mug",))
    a, b = tmp_path / "a", tmp_path / "b"
    export_bundle(checkpoint, perception, a, "one")
    tensors, head = load_tensors(checkpoint)
    tensors["model.policy.actor.weight"] += 1
    save_tensors(checkpoint, tensors, {k: head[k] for k in head if k not in ("schema", "kind")})
    export_bundle(checkpoint, perception, b, "one")
    assert (a / "policy.onnx").read_bytes() == (b / "policy.onnx").read_bytes()
    assert identity_of(a) != identity_of(b)


def test_trials_of_another_bundle_are_not_mixed(bundles: Path, tmp_path: Path) -> None:
    config = TableIV(bundles=bundles, rows="paper", out=tmp_path)
    _driven(tmp_path / "plain_seed0_15.jsonl", config, "plain", 3)
    put_bundle(bundles / "plain_seed0", [Action.Done])
    with pytest.raises(OSError, match="holds trials of another bundle"):
        run(config, "")
    path = tmp_path / "plain_seed0_15.jsonl"
    path.write_text(path.read_text().splitlines()[0].replace(WORLD, "older") + "\n")
    with pytest.raises(OSError, match="in another version of the simulator"):
        run(config, "")
    with pytest.raises(ValueError, match="found 15 trials for 4 seeds"):
        run(TableIV(bundles=bundles, seeds=4), "")


@pytest.mark.ros
def test_the_graph_drives_what_is_missing(
    bundles: Path, tmp_path: Path, start_process: Callable, ros_domain_id: int
) -> None:
    config = TableIV(bundles=bundles, rows="paper", out=tmp_path / "out", trials=3)
    command = [
        "table-iv", "--bundles", str(bundles), "--rows", "paper", "--trials", "3",
        "--out", str(config.out), "--domain", str(ros_domain_id),
    ]  # fmt: skip
    first = start_process("studies.live.trials", *command, "--only", "plain")
    assert first.wait(300) == 0, first.output
    rows = [json.loads(line) for line in (config.out / "plain_seed0_3.jsonl").open()]
    assert [row["room"] for row in rows] == list(ROOMS)
    assert all(row["outcome"] == "done" and row["steps"] == 3 for row in rows)
    for row in rows:
        way = np.hypot(*np.diff(np.array(row["track"])[:, :2], axis=0).T).sum()
        assert way == pytest.approx(row["path_length_m"], abs=0.05)
        assert row["track"][-1][2] == row["collisions"]
    assert len(list((config.out / "maps").iterdir())) == 3
    # as if it had been killed in its second trial
    path = config.out / "plain_seed0_3.jsonl"
    path.write_text(json.dumps(rows[0]) + "\n" + json.dumps(rows[1])[:40])
    again = start_process("studies.live.trials", *command, "--only", "plain")
    assert again.wait(300) == 0, again.output
    assert "training seed 0: 2 trials" in again.output
    went_on = [json.loads(line) for line in path.open()]
    assert went_on[0] == rows[0]
    assert [row["trial"] for row in went_on] == [row["trial"] for row in rows]


@pytest.mark.ros
def test_the_simulator_tells_the_truth_in_place_of_the_lidar(
    tmp_path: Path, ros_domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    from cfnav_ros.process.graph_config import GraphConfig
    from cfnav_ros.ros.graph import RosGraph

    for name in ("ROS_DOMAIN_ID", "ROS_LOG_DIR"):  # the graph sets them
        monkeypatch.setenv(name, os.environ.get(name, ""))
    room = "bathroom:20"
    world = World(generate_room(*parse_room(room)))
    x, y, yaw = _two_steps_from_an_obstacle(world)
    bundle = make_bundle(tmp_path, {"Sink": [*[Action.MoveAhead] * 3, Action.Done]})
    config = GraphConfig(
        room, tmp_path / "logs", 0.0, bundle, veto=False, lock_step=True, p_hat="true",
        domain=ros_domain_id,
    )  # fmt: skip
    with RosGraph(config) as graph:
        assert set(graph.children) == {"mock_turtlebot4", "policy_node"}
        assert graph.start_episode(room, "Sink", 0, (x, y, yaw)).ok
        heard: list[float] = []
        outcome = graph.run_episode(
            room, "Sink", on_step=lambda step: heard.append(step.collision_probability)
        )
    assert heard == [0.0, 0.0, 1.0, heard[3]]
    assert outcome.collisions > 0


def _two_steps_from_an_obstacle(world: World) -> tuple[float, float, float]:
    """A pose from which MoveAhead is free twice, with 3 cm to spare, and then hits something."""
    for x in np.arange(0.3, world.room.width, 0.05):
        for y in np.arange(0.3, world.room.depth, 0.05):
            for yaw in np.arange(8) * np.pi / 4:
                c, s = np.cos(yaw), np.sin(yaw)
                free, blocked = ((x + d * c, y + d * s) for d in (0.56, 0.68))
                if world.sweep_free((x, y), free) and not world.free(*blocked):
                    return float(x), float(y), float(yaw)
    raise AssertionError(f"{world.room.name} has no such place")
