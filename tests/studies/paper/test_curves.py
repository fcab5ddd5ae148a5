"""Learning curves of runs that go on from another's stage one."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from cfnav_core.learn.run_files import LOG
from studies.engine.jobs import GridFolders, Job
from studies.paper.curves import Curve, Learned, gaps_as_markdown


def write_log(job: Job, places: GridFolders, lines: list[tuple[int, float]]) -> None:
    path = job.options(places).out / LOG
    path.parent.mkdir(parents=True)
    rows = ({"episodes": n, "cf_sr": y, "validation_cf_sr": y / 2} for n, y in lines)
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))


def test_a_shared_stage_one_ends_before_the_validation_that_feeds_p_hat(tmp_path: Path) -> None:
    ours, places = (
        Job("lstde", "ours", "data1", 0, "small", "eyes"),
        GridFolders(tmp_path, tmp_path),
    )
    plain = Job("lstde", "plain", "data1", 0, "small", "eyes")
    end = ours.config.hyperparameters.stage1_episodes
    write_log(ours, places, [(end - 5000, 0.1), (end + 12, 0.2), (end + 5000, 0.9)])
    write_log(plain, places, [(end + 5012, 0.3), (end + 10_000, 0.4)])
    curve = Curve.read(plain, places)
    assert curve.episodes.tolist() == [end - 5000, end + 5012, end + 10_000]
    assert curve.values["cf_sr"].tolist() == [0.1, 0.3, 0.4]
    assert curve.values["validation_cf_sr"].tolist() == [0.05, 0.15, 0.2]
    assert Curve.read(ours, places).episodes.tolist() == [end - 5000, end + 12, end + 5000]


def test_the_gap_is_that_of_the_ends_of_the_curves() -> None:
    def curve(known: list[float], unseen: list[float]) -> Curve:
        values = {"cf_sr": np.array(known), "validation_cf_sr": np.array(unseen)}
        return Curve(np.arange(len(known)), values)

    a = curve([0.0, 0.6, 0.6], [1.0, 0.4, 0.4])
    b = curve([0.0, 0.8, 0.8], [1.0, 0.4, 0.4])
    assert gaps_as_markdown([Learned("CP Only", [a, b]), Learned("ours", [a])]).splitlines()[
        2:
    ] == [
        "| CP Only | 70.0 ± 14.1 | 40.0 ± 0.0 | 30.0 ± 14.1 |",
        "| ours | 60.0 | 40.0 | 20.0 |",
    ]


def test_stage_two_begins_only_where_it_differs(tmp_path: Path) -> None:
    ours, places = (
        Job("lstde", "ours", "data1", 0, "small", "eyes"),
        GridFolders(tmp_path, tmp_path),
    )
    reward = Job("lstde", "reward", "data1", 0, "small", "eyes")
    for job in (ours, reward):
        write_log(job, places, [(5000, 0.1)])
    end = ours.config.hyperparameters.stage1_episodes
    assert Learned.read("ours", [ours], places).stage2_from == end
    assert Learned.read("Reward", [reward], places).stage2_from is None
