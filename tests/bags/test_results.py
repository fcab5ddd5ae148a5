"""The files for programs: the same numbers as the evaluation, every cell readable."""

import csv
import dataclasses
import io
import json
import math

import numpy as np
import pytest
from cfnav_ros.bags.evaluation import JudgeOptions, evaluate
from cfnav_ros.bags.film import FRAMES, MOMENTS, Film, key_stamps, moment_stamps
from cfnav_ros.bags.results import (
    DECISION_COLUMNS,
    DECISIONS,
    DRIVE_COLUMNS,
    DRIVES,
    HEALTH,
    METRICS,
    left_out,
    result_files,
)
from cfnav_ros.bags.summary import drives_in, summarise
from cfnav_ros.report.bag_eval import table
from PIL import Image

from cfnav_core.task.actions import Action
from studies.bags.bag_files import VARIANTS, S, image
from studies.bags.bag_files import drive as recorded
from tests.bags.evaluations import (
    BUNDLES,
    answers,
    by_two_drivers,
    evaluated,
    evaluation,
    made_drive,
)
from tests.bags.steps import step_of


def files(evaluations):
    return result_files(evaluations, summarise(evaluations), {"seed": "7"})


def rows(text):
    return list(csv.DictReader(io.StringIO(text)))


def numbers(value):
    if isinstance(value, dict):
        return [n for item in value.values() for n in numbers(item)]
    if isinstance(value, list):
        return [n for item in value for n in numbers(item)]
    return [value] if isinstance(value, float) else []


@pytest.fixture(scope="module")
def written():
    return files([evaluation("a"), evaluation("b")])


def test_metrics_hold_the_figures_of_the_summary(written):
    summary = summarise([evaluation("a"), evaluation("b")])
    metrics = json.loads(written[METRICS])
    assert metrics["facts"] == {"seed": "7"}
    assert metrics["figures"]["sr"]["value"] == pytest.approx(2 / 3)
    assert metrics["figures"]["cf_sr"]["value"] == pytest.approx(1 / 3)
    assert metrics["figures"]["cf_sr"]["low"] == summary.figures["cf_sr"].low
    assert metrics["figures"]["cf_sr"]["sources"] == {"truth": 6}
    assert metrics["figures"]["impact_speed"]["left_out"] == {"it touched nothing": 4}
    assert [d["collisions"] for d in metrics["drives"]] == [0, 2, 0] * 2
    assert [b["name"] for b in metrics["bags"]] == ["a", "b"]
    assert metrics["bags"][0]["rates"][1]["rate"] is None
    assert metrics["bags"][0]["findings"][0]["text"].startswith("1 gaps")


def test_metrics_hold_the_scores_of_each_bundle_and_their_comparison(written):
    metrics = json.loads(written[METRICS])
    ours, plain = metrics["bundles"]
    assert (ours["name"], ours["own_name"], ours["decisions"]) == ("ours", "shipped", 36)
    assert ours["agreement"]["overall"]["value"] == 1.0
    assert plain["agreement"]["overall"]["value"] == 0.5
    assert plain["agreement"]["answers"]["MoveAhead"]["RotateRight"] == 18
    # of the three MoveAheads of a drive one is vetoed; the first of the touching drives collides
    assert ours["collision"]["lidar"]["moves"] == 12
    assert ours["collision"]["lidar"]["collisions"] == 2
    assert ours["collision"]["rgb"]["roc"][0] == [None, 0.0, 0.0]
    assert (ours["left_out"], plain["left_out"]) == (6, 4)
    (pair,) = metrics["comparison"]
    assert (pair["first"], pair["second"]) == tuple(BUNDLES)
    assert (pair["steps"], pair["not_paired"]) == (36, 0)
    assert pair["agreement"]["value"] == pytest.approx(-0.5)


def test_only_decisions_of_drives_with_its_own_name_are_its_own(written):
    ours, plain = json.loads(written[METRICS])["bundles"]
    assert ours["reproduction"]["decisions"] == 36
    assert plain["reproduction"]["decisions"] == 0
    assert plain["reproduction"]["p_hat_difference"] is None


def test_of_bags_with_a_bundle_each_every_bundle_has_the_figures_of_its_own():
    def only(name, bundle):
        """A bag over which one bundle was replayed."""
        made = evaluation(name)
        drives = [
            dataclasses.replace(d, steps=tuple(s for s in d.steps if s.bundle == bundle))
            for d in made.drives
        ]
        return dataclasses.replace(made, bundles={bundle: BUNDLES[bundle]}, drives=tuple(drives))

    first, second = BUNDLES
    both = [only("a", first), only("b", second)]
    ours, plain = json.loads(files(both)[METRICS])["bundles"]
    assert (ours["decisions"], plain["decisions"]) == (18, 18)
    assert (ours["left_out"], plain["left_out"]) == (3, 2)
    assert summarise(both).pairs == {}


def test_each_driver_has_its_own_figures_when_there_are_several(written):
    both = by_two_drivers()
    metrics = json.loads(files(both)[METRICS])
    assert metrics["figures"]["sr"]["value"] == pytest.approx(3 / 4)
    theirs, ours = metrics["drivers"]
    assert (theirs["name"], ours["name"]) == ("<i>theirs", "shipped")
    assert (ours["figures"]["sr"]["value"], ours["figures"]["sr"]["drives"]) == (1.0, 1)
    assert theirs["figures"]["sr"]["value"] == pytest.approx(2 / 3)
    assert theirs["figures"]["cf_sr"]["value"] == pytest.approx(1 / 3)
    assert theirs["figures"]["cf_sr"]["drives"] == 3
    assert [row["bundle"] for row in rows(files(both)[DRIVES])] == ["shipped", *["<i>theirs"] * 3]
    assert json.loads(written[METRICS])["drivers"] == []


def test_the_terminal_shows_drivers_apart():
    both = by_two_drivers()
    lines = table(both, summarise(both)).splitlines()
    assert [line.split()[-1] for line in lines[1:5]] == ["shipped", *["<i>theirs"] * 3]
    of_theirs = lines.index("driver <i>theirs")
    assert lines[of_theirs + 1].startswith("cf_sr   0.33 95 %: ")
    assert lines[of_theirs + 2].endswith("(3 drives)")
    one = [evaluation()]
    assert "driver shipped" not in table(one, summarise(one))


def test_tables_have_a_row_a_drive_and_a_row_a_decision_and_bundle(written):
    drives, decisions = rows(written[DRIVES]), rows(written[DECISIONS])
    assert list(drives[0]) == list(DRIVE_COLUMNS)
    assert list(decisions[0]) == list(DECISION_COLUMNS)
    assert [(d["bag"], d["drive"], d["goal"]) for d in drives[1:4]] == [
        ("a", "2", "<i>&Fridge"), ("a", "3", "Book"), ("b", "4", "Mug"),
    ]  # fmt: skip
    touching = drives[1]
    assert (touching["collisions"], touching["collisions_source"]) == ("2", "truth")
    assert (touching["collisions_bump"], touching["collisions_stall"]) == ("2", "0")
    assert (touching["cf_success"], touching["impact_speed"]) == ("False", "0.2")
    assert drives[0]["impact_speed"] == ""
    assert drives[0]["missing"] == "impact_speed: it touched nothing"
    assert len(decisions) == 2 * 6 * 6
    moved = [d for d in decisions if d["driven"] == "MoveAhead" and d["bundle"] != "ours"]
    assert {(d["action"], d["agrees"]) for d in moved} == {("RotateRight", "False")}
    assert float(moved[0]["p_RotateRight"]) == pytest.approx(0.75)
    assert float(moved[0]["p_driven"]) == pytest.approx(0.05)
    assert float(moved[0]["seconds"]) == pytest.approx(0.5)
    assert {d["collided"] for d in decisions if d["driven"] != "MoveAhead"} == {""}
    assert len(rows(written[HEALTH])) == 2


def test_numbers_are_finite_or_nothing():
    made = made_drive()
    odd = step_of(p_hat=math.nan, p_hat_rgb=math.inf, t_ns=made.start_ns, image_ns=1)
    drive = dataclasses.replace(evaluated(made), steps=(odd,))
    text = files([evaluation(drives=[], findings=()), evaluation("b", [])])
    assert json.loads(text[METRICS])["figures"]["sr"]["value"] is None
    assert rows(text[DRIVES]) == []
    one = dataclasses.replace(evaluation("c", []), drives=(drive,))
    (row,) = rows(result_files([one], summarise([evaluation("c", [])]), {})[DECISIONS])
    assert (row["p_hat"], row["p_hat_rgb"]) == ("", "")
    assert all(map(math.isfinite, numbers(json.loads(files([evaluation()])[METRICS]))))


def test_what_was_left_out_for_the_same_reason_is_counted_together():
    assert left_out(evaluation()) == [
        ("", "The bag holds no picture stamped 3.5 s.", 2),
        ("ours", "It does not take this goal: <Fridge>.", 1),
    ]


def answerable(messages):
    """The messages with pictures large enough, decisions on the scans of their pictures' times."""
    made = []
    for n, m in enumerate(messages):
        message = m.message
        if m.type.endswith("/Image"):
            t = message.header.stamp
            message = image(t.sec * S + t.nanosec, n, side=160)
        elif m.type.endswith("/PolicyDecision"):
            message = dataclasses.replace(message, estimate_stamp=message.image_stamp)
        made.append(m._replace(message=message))
    return made


def test_a_real_bag_gives_the_same_files_whatever_its_storage(tmp_path):
    texts, messages = [], answerable(recorded(6.0))
    for name in ("mcap zstd storage", "sqlite split"):
        path = VARIANTS[name](tmp_path / name.replace(" ", "_"), messages)
        found = evaluate(path, JudgeOptions(bundles={"ours": ""}), name="drive")
        ((_, only),) = drives_in([found])
        assert (found.name, found.bundles) == ("drive", {"ours": "default"})
        assert len(only.points) > 20
        assert 0 < len(only.pictures) <= FRAMES + MOMENTS
        texts.append(files([found]))
    assert texts[0] == texts[1]
    (drive,) = rows(texts[0][DRIVES])
    assert (drive["goal"], drive["collisions_bump"]) == ("Laptop", "1")
    assert len(rows(texts[0][DECISIONS])) == int(drive["steps"]) == 12
    assert json.loads(texts[0][METRICS])["bags"][0]["left_out"] == []


def test_film_keeps_the_surest_disagreements_beside_the_course_of_a_drive():
    drive = made_drive()
    stamps = [drive.start_ns + i for i in range(100)]
    p = np.eye(6, dtype=np.float32)[Action.RotateLeft]
    sure = [
        step_of(image_ns=stamps[k], action=Action.RotateLeft,
                probabilities=p * (1 - 0.01 * k) + 0.01 * k / 6)
        for k in (51, 52, 53, 54, 55, 56)
    ]  # fmt: skip
    assert moment_stamps(sure, stamps) == stamps[51:55]
    assert moment_stamps([*answers(drive), *sure], set(stamps)) == stamps[51:55]
    film = Film()
    for i, stamp in enumerate(stamps):
        film.add(stamp, stamp, np.full((30, 40, 3), i, np.uint8))
    kept = film.cut(drive, sure)
    assert list(kept) == sorted(
        {*key_stamps(drive, dict(zip(stamps, stamps, strict=True))), *stamps[51:55]}
    )
    assert len(kept) <= FRAMES + MOMENTS
    assert film.cut(drive, sure) == {}


@pytest.mark.parametrize(
    ("seen", "shown"),
    [
        ((30, 40), (30, 40)),
        ((300, 300), (300, 300)),
        ((480, 640), (225, 300)),
        ((4, 3000), (1, 300)),
    ],
)
def test_pictures_of_a_film_are_small_jpegs_in_their_own_colours(seen, shown):
    drive = made_drive()
    film = Film()
    film.add(drive.start_ns, drive.start_ns, np.full((*seen, 3), (200, 90, 20), np.uint8))
    (file,) = film.cut(drive).values()
    with Image.open(io.BytesIO(file), formats=["JPEG"]) as picture:
        assert np.abs(np.asarray(picture) - np.full((*shown, 3), (200.0, 90, 20))).max() <= 3


@pytest.mark.parametrize("name", ["=cmd|'/c calc'!A1", "+1", "-1", "@SUM(A1)", "\t=1", "\r=1"])
def test_a_bags_name_is_no_formula_in_a_table(name):
    written = files([evaluation(name)])
    told = {row["bag"] for file in (DRIVES, HEALTH) for row in rows(written[file])}
    assert told == {"'" + name.replace("\r", "\n")}
    assert json.loads(written[METRICS])["bags"][0]["name"] == name
