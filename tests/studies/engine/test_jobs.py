"""Which runs the rows need, what identifies them, and what they wait for."""

from __future__ import annotations

import csv
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from cfnav_core.agent.methods import METHODS
from cfnav_core.learn.run_files import STAGE1
from cfnav_core.task.rooms import SPLITS
from studies.engine.jobs import GridFolders, Job, jobs_of
from studies.engine.presets import MODELS, PRESETS
from studies.paper.rows import PAIRS, ROWS

PLACES = GridFolders(Path("rooms"), Path("grid"))
PERCEPTION = "2832f1d31056fdb8"
"""Identity of the one that the recorded results were made with."""

OURS = Job("lstde", "ours", "data1", 0, "small", "p")


def test_the_tables_have_the_papers_rows() -> None:
    tables = {name: [row for row in ROWS if row.table == name] for name in ("I", "II", "III")}
    assert [len(rows) for rows in tables.values()] == [14, 5, 4]
    assert len(PAIRS) == 7
    for rows in tables.values():
        assert all(row.paper for row in rows)
        assert len({(row.name, row.split) for row in rows}) == len(rows)
    ours = [row for row in tables["I"] if row.method == "ours"]
    assert all(row.name.startswith("ours (") and row.against == "plain" for row in ours)


def test_a_run_that_rows_share_is_made_once() -> None:
    jobs = jobs_of(ROWS, range(5), "small", "p")
    assert len(set(jobs)) == len(jobs)
    assert len({job.name for job in jobs}) == len(jobs)
    assert sum((j.model, j.method, j.schedule) == ("lstde", "plain", "usual") for j in jobs) == 5
    # 7 pairs with 2 methods; of L-sTDE 7 others and 2 longer, of TDANet Stage Only, Reward Only
    # and Truth, of HOZ 2 with a later stage two, of TDANet 5 and of L-sTDE 3 trained tenfold
    assert len(jobs) == 5 * (7 * 2 + 7 + 2 + 3 + 2 + 5 + 3)


def test_rows_as_long_have_as_many_episodes_and_the_same_stage_one() -> None:
    rows = [row for row in ROWS if row.schedule == "longer"]
    jobs = {row.method: Job.of_row(row, 0, "small", "p") for row in rows}
    numbers = [job.config.hyperparameters for job in jobs.values()]
    assert set(jobs) == {"plain", "reward", "xiao", "ours"}
    assert len({hp.stage1_episodes + hp.stage2_episodes for hp in numbers}) == 1
    assert jobs["ours"].stage1 == jobs["plain"].stage1 == OURS
    assert jobs["reward"] == replace(OURS, method="reward")
    references = {row.reference for row in rows if row.reference}
    assert {Job.of_row(of, 0, "small", "p") for of in references} == {jobs["plain"]}


def test_a_later_stage_two_follows_a_stage_one_of_its_own() -> None:
    rows = [row for row in ROWS if row.schedule == "later"]
    plain, ours = (Job.of_row(row, 0, "small", "p") for row in rows)
    assert (plain.method, ours.method) == ("plain", "ours")
    assert Job.of_row(rows[1].reference, 0, "small", "p") == plain
    assert plain.stage1 == ours
    assert ours.stage1 is None
    usual = replace(ours, schedule="usual")
    for job, sooner in ((ours, usual), (plain, replace(usual, method="plain"))):
        numbers, before = (of.config.hyperparameters for of in (job, sooner))
        assert numbers.stage1_episodes > before.stage1_episodes
        assert numbers.stage2_episodes == before.stage2_episodes
        assert job.name != sooner.name


@pytest.mark.parametrize(
    ("model", "methods"),
    [
        ("tdanet", {"plain", "reward_only", "stage_only", "truth", "ours"}),
        ("lstde", {"plain", "stage_only", "ours"}),
    ],
)
def test_tenfold_runs_go_on_from_the_usual_stage_one(model: str, methods: set[str]) -> None:
    rows = [row for row in ROWS if row.table == "tenfold" and row.model == model]
    jobs = {row.method: Job.of_row(row, 0, "small", "p") for row in rows}
    assert set(jobs) == methods
    ours = replace(jobs["ours"], schedule="usual")
    for method, job in jobs.items():
        usual = replace(ours, method=method)
        assert job.stage1 == (ours if method in ("plain", "stage_only", "truth") else usual)
        numbers, before = (of.config.hyperparameters for of in (job, usual))
        assert numbers == replace(before, stage2_episodes=10 * before.stage2_episodes)
    references = {Job.of_row(row.reference, 0, "small", "p") for row in rows if row.reference}
    assert references == {jobs["plain"]}


def test_tenfold_rows_have_the_papers_numbers_of_the_usual_ones() -> None:
    rows = [row for row in ROWS if row.table == "tenfold" and row.paper]
    usual = {(row.model, row.method): row.paper for row in ROWS if row.table in ("I", "II", "III")}
    assert {(row.model, row.method): row.paper for row in rows}.items() <= usual.items()
    assert [row.model for row in rows] == ["tdanet"] * 2 + ["lstde"] * 3


def test_a_variant_has_a_stage_one_of_its_own() -> None:
    listening = replace(OURS, variant="listening")
    assert listening.stage1 is None
    assert replace(listening, schedule="tenfold").stage1 == listening
    assert listening.title == "data1 lstde ours listening seed0"


def test_what_is_waited_for_comes_first() -> None:
    jobs = jobs_of(ROWS, range(2), "small", "p")
    for place, job in enumerate(jobs):
        assert job.stage1 is None or job.stage1 in jobs[:place]


@pytest.mark.parametrize(
    ("method", "shares"),
    [("ours", False), ("plain", True), ("stage_only", True), ("reward", False), ("xiao", False),
     ("wu", False), ("cp_only", False), ("reward_only", False)],
)  # fmt: skip
def test_methods_share_a_stage_one_without_rules_of_its_own(method: str, shares: bool) -> None:
    job = replace(OURS, method=method)
    assert (job.stage1 == OURS) is shares
    source = job.options(PLACES).stage1
    assert source == (OURS.options(PLACES).out / STAGE1 if shares else None)


def test_recorded_runs_are_still_those_of_the_rows() -> None:
    """Whoever changes a number that a hash is of takes the recorded results from their rows."""
    with Path("docs/results/runs.csv").open() as file:
        recorded = {line["run"] for line in csv.DictReader(file)}
    assert recorded <= {job.name for job in jobs_of(ROWS, range(5), "small", PERCEPTION)}


def test_the_hash_tells_configurations_apart() -> None:
    others = [
        replace(OURS, seed=1), replace(OURS, method="plain"), replace(OURS, model="hoz"),
        replace(OURS, split="data2"), replace(OURS, preset="full"), replace(OURS, perception="q"),
        replace(OURS, schedule="longer"), replace(OURS, schedule="tenfold"),
        replace(OURS, variant="listening"), replace(OURS, variant="dropout"),
    ]  # fmt: skip
    assert len({job.hash for job in (OURS, *others)}) == 11


def test_rooms_are_those_of_the_split_and_test_rooms_stay_unseen() -> None:
    options = OURS.options(PLACES)
    assert (options.train_rooms, options.validation_rooms) == (
        ("data1:train",), ("data1:validation",),
    )  # fmt: skip
    for split in SPLITS.values():
        assert not set(split["test"]) & {*split["train"], *split["validation"]}


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_has_every_model(preset: str) -> None:
    assert set(PRESETS[preset].runs) == set(MODELS) == {row.model for row in ROWS}


def test_only_methods_with_a_penalty_in_stage_one_begin_stage_two_later() -> None:
    later = {
        method for method in METHODS
        if replace(OURS, method=method).config.hyperparameters.stage1_episodes
        > OURS.config.hyperparameters.stage1_episodes
    }  # fmt: skip
    assert later == {"reward", "xiao", "reward_only"}


def test_nothing_is_longer_in_a_preset_whose_methods_are_all_as_long() -> None:
    row = next(row for row in ROWS if row.schedule == "longer" and row.method == "ours")
    full, small = (Job.of_row(row, 0, preset, "eyes") for preset in ("full", "small"))
    assert full == replace(OURS, preset="full", perception="eyes")
    assert small.schedule == "longer"
    row = next(row for row in ROWS if row.schedule == "tenfold" and row.method == "ours")
    full, small = (Job.of_row(row, 0, preset, "eyes") for preset in ("full", "small"))
    assert (full.schedule, small.schedule) == ("usual", "tenfold")


def test_a_bundle_names_the_run_that_it_came_from() -> None:
    job = Job("tdanet", "reward_only", "data2", 3, "small", "eyes")
    training = {
        "config": asdict(job.config), "train_rooms": ["data2:train"], "perception": "eyes",
    }  # fmt: skip
    assert Job.of(training) == job
    tenfold = replace(job, schedule="tenfold")
    listening = replace(tenfold, method="ours", variant="listening")
    for other in (tenfold, listening):
        assert Job.of(training | {"config": asdict(other.config)}) == other
    unknown = replace(job.config, predictor_hidden=99)
    assert Job.of(training | {"config": asdict(unknown)}) is None
    assert Job.of(training | {"train_rooms": ["kitchen:0-15"]}) is None
    assert Job.of({}) is None


def test_ours_is_compared_with_other_methods_trained_and_acting_alike() -> None:
    by_name = {row.name: row for row in ROWS if row.table == "tenfold" and row.model == "tdanet"}
    ours, plain = by_name["ours (TDANet)"], by_name["TDANet"]
    assert ours.rival is None
    assert plain.rival is None
    for name in ("Stage Only (TDANet)", "TDANet, LiDAR veto", "Truth (TDANet), actions drawn"):
        rival = by_name[name].rival
        assert rival is not None
        assert (rival.method, rival.p_hat, rival.veto) == ("ours", "own", False)
        assert (rival.schedule, rival.sample) == ("tenfold", by_name[name].sample)
    assert by_name["Truth (TDANet), LiDAR for p_hat"].rival is None
    assert by_name["TDANet, LiDAR veto"].itself is None
    assert by_name["ours (TDANet), LiDAR veto"].itself is not None
