"""The rows of the paper's tables, and rows of our own beside them. Plain data.

Source: Tables I to III and the sections that describe them. Numbers are percent, mean and standard
deviation over five trials.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from cfnav_core.agent.config import MethodName, ModelName
from cfnav_core.task.p_hat import PHat
from studies.engine.row import Claimed, Row, Split

PAPER = ("I", "II", "III")
"""Tables of the paper; "own" has rows that it lacks, "tenfold" those that are trained so."""

PAIRS: tuple[tuple[ModelName, Split, Claimed, Claimed], ...] = (
    ("baseline_label", "data1", Claimed((55.8, 2.7), (32.2, 1.8)),
     Claimed((59.3, 1.0), (33.1, 1.5))),
    ("hoz", "data1", Claimed((58.1, 0.9), (33.2, 0.5)), Claimed((60.2, 1.3), (34.1, 0.7))),
    ("lstde", "data1", Claimed((60.0, 0.4), (34.0, 1.1)), Claimed((65.3, 0.6), (35.9, 0.9))),
    ("akgvp", "data1", Claimed((70.5, 0.7), (40.4, 0.8)), Claimed((74.4, 0.7), (41.6, 0.5))),
    ("baseline_word", "data2", Claimed((27.1, 1.1), (8.4, 0.4)),
     Claimed((30.1, 0.7), (9.5, 0.1))),
    ("mjolnir", "data2", Claimed((47.2, 4.1), (17.9, 2.1)), Claimed((55.8, 5.0), (21.0, 2.3))),
    ("tdanet", "data2", Claimed((53.5, 1.5), (23.4, 1.2)), Claimed((60.5, 2.3), (25.8, 0.7))),
)  # fmt: skip
"""Table I: model and split, as it is and with the paper's method."""

NAMES: dict[ModelName, str] = {
    "baseline_label": "Baseline", "baseline_word": "Baseline", "hoz": "HOZ", "lstde": "L-sTDE",
    "akgvp": "AKGVP", "mjolnir": "MJOLNIR-r", "tdanet": "TDANet",
}  # fmt: skip
"""Models by the names of the paper's tables."""

Between = tuple[str, MethodName, Claimed | None]
"""A row between plain and ours: its name, its method, and what the paper says."""

COMPARED: tuple[Between, ...] = (
    ("Reward", "reward", Claimed((61.2, 2.3), (34.2, 1.2))),
    ("Xiao et al.", "xiao", Claimed((61.5, 1.7), (34.2, 1.4))),
    ("Wu et al.", "wu", Claimed((61.6, 1.7), (34.4, 0.5))),
)
"""Table II, on L-sTDE and Offline Data 1."""

ABLATION: tuple[Between, ...] = (
    ("Stage Only", "stage_only", Claimed((63.3, 0.5), (35.3, 0.2))),
    ("CP Only", "cp_only", Claimed((60.2, 1.3), (33.5, 1.3))),
)
"""Table III, on the same."""

GIVEN: dict[PHat, str] = {
    "zero": "zero for p_hat", "other_episode": "another episode's p_hat",
    "true": "the true flag for p_hat",
    "lidar": "LiDAR for p_hat", "both": "the larger of LiDAR and p_hat",
}  # fmt: skip
"""In place of the policy's own prediction."""

TOLD: tuple[PHat, ...] = ("own", "true", "lidar", "both")
"""What a policy that was told the truth in training is given at test."""

STUDIED: tuple[ModelName, Split] = ("lstde", "data1")
"""What Tables II and III are about."""

LATE: tuple[ModelName, Split] = ("hoz", "data1")
"""What begins to walk at very different times in different seeds."""

DRIVEN: tuple[ModelName, Split] = ("tdanet", "data2")
"""What Table IV drives; its other methods are rows of our own here."""


def _table1() -> list[Row]:
    rows = []
    for model, split, plain, ours in PAIRS:
        name = NAMES[model]
        rows.append(Row("I", name, model, "plain", split, plain))
        rows.append(Row("I", f"ours ({name})", model, "ours", split, ours, against="plain"))
    return rows


def _compared(table: str, pair: tuple[ModelName, Split], between: Iterable[Between]) -> list[Row]:
    """Plain, other methods, and ours of one pair."""
    model, split = pair
    name = NAMES[model]
    plain, ours = next(of[2:] for of in PAIRS if of[:2] == pair)
    return [
        Row(table, name, model, "plain", split, plain),
        *[Row(table, title, model, method, split, paper, against="plain")
          for title, method, paper in between],
        Row(table, f"ours ({name})", model, "ours", split, ours, against="plain"),
    ]  # fmt: skip


def _own() -> list[Row]:
    """What the probability is worth, and the LiDAR, in every pair."""
    rows = []
    for model, split, *_ in PAIRS:
        name = NAMES[model]
        for p_hat, words in GIVEN.items():
            rows.append(
                Row("own", f"ours ({name}), {words}", model, "ours", split, p_hat=p_hat,
                    against="plain")
            )  # fmt: skip
        rows += [
            Row("own", f"{name}, LiDAR veto", model, "plain", split, veto=True, against="plain"),
            Row("own", f"ours ({name}), LiDAR veto", model, "ours", split, veto=True,
                against="plain"),
            Row("own", f"ours ({name}), LiDAR for p_hat and veto", model, "ours", split,
                p_hat="lidar", veto=True, against="plain"),
        ]  # fmt: skip
    others: tuple[tuple[tuple[ModelName, Split], MethodName, str, tuple[PHat, ...]], ...] = (
        (STUDIED, "reward_only", "Reward Only", ("own",)),
        (STUDIED, "truth", "Truth", TOLD),
        (DRIVEN, "reward_only", "Reward Only", ("own",)),
        (DRIVEN, "stage_only", "Stage Only", ("own",)),
        (DRIVEN, "truth", "Truth", TOLD),
    )
    for (model, split), method, name, given in others:
        for p_hat in given:
            words = "" if p_hat == "own" else f", {GIVEN[p_hat]}"
            title = f"{name} ({NAMES[model]}){words}"
            rows.append(Row("own", title, model, method, split, p_hat=p_hat, against="plain"))
    return rows


def _drawn() -> list[Row]:
    """Actions drawn at test, as MJOLNIR-r and the Baseline of data2 were published.

    The paper's tables here take the most probable ones, with which an agent may turn on the spot
    for ever.
    """
    rows = []
    for model, split, *_ in PAIRS:
        name = NAMES[model]
        rows += [
            Row("own", f"{name}, actions drawn", model, "plain", split, sample=True),
            Row("own", f"ours ({name}), actions drawn", model, "ours", split, against="plain",
                sample=True),
        ]  # fmt: skip
    return rows


def _as_long() -> list[Row]:
    """What remains of the differences in Table II when all are trained for as many episodes."""
    model, split = STUDIED
    compared: tuple[tuple[MethodName, str, MethodName | None], ...] = (
        ("plain", NAMES[model], None), ("reward", "Reward", "plain"),
        ("xiao", "Xiao et al.", "plain"), ("ours", f"ours ({NAMES[model]})", "plain"),
    )  # fmt: skip
    return [
        Row("own", f"{name}, all as long", model, method, split, against=against, schedule="longer")
        for method, name, against in compared
    ]


def _later() -> list[Row]:
    """A pair whose agents walk late in some seeds, with a stage two that waits for it.

    Added when two of five seeds were tested: in the second ours had not begun to walk when stage
    two began, and never did.
    """
    model, split = LATE
    name = NAMES[model]
    return [
        Row("own", f"{name}, stage two later", model, "plain", split, schedule="later"),
        Row("own", f"ours ({name}), stage two later", model, "ours", split, against="plain",
            schedule="later"),
    ]  # fmt: skip


def _tenfold() -> list[Row]:
    """What Table IV drives, and Stage Only in L-sTDE, with ten times the stage two.

    Added when results of the usual ones had been seen: TDANet's when live trials of policies
    trained so shortly hardly reached a goal, whatever the method; L-sTDE's when Stage Only was as
    good as ours in two of five seeds, which it is not in TDANet trained so.
    """
    name = NAMES[DRIVEN[0]]
    driven: tuple[Between, ...] = (
        (f"Reward Only ({name})", "reward_only", None),
        (f"Stage Only ({name})", "stage_only", None),
        (f"Truth ({name})", "truth", None),
    )
    told: dict[MethodName, tuple[PHat, ...]] = {"ours": tuple(GIVEN), "truth": TOLD[1:]}
    rows = []
    for pair, between in ((DRIVEN, driven), (STUDIED, ABLATION[:1])):
        found = [replace(row, schedule="tenfold") for row in _compared("tenfold", pair, between)]
        for row in found:
            rows.append(row)
            rows += [replace(row, name=f"{row.name}, {GIVEN[p_hat]}", paper=None, p_hat=p_hat)
                     for p_hat in told.get(row.method, ())]  # fmt: skip
        rows += [replace(row, name=f"{row.name}, LiDAR veto", paper=None, veto=True,
                         against="plain")
                 for row in found if row.method in ("plain", "ours")]  # fmt: skip
        rows += [replace(row, name=f"{row.name}, actions drawn", paper=None, sample=True)
                 for row in found]  # fmt: skip
    return rows


ROWS: tuple[Row, ...] = (
    *_table1(), *_compared("II", STUDIED, COMPARED), *_compared("III", STUDIED, ABLATION),
    *_own(), *_drawn(), *_as_long(), *_later(), *_tenfold(),
)  # fmt: skip
