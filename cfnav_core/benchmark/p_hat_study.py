"""How p_hat should enter: ``python -m cfnav_core.benchmark.p_hat_study``, in validation rooms.

The paper feeds one number and does not say where. Here the methods of a grid stand beside variants
of ours, each given other probabilities. No test room is looked at, and nothing is chosen for the
tables of the paper.
"""

from __future__ import annotations

import json
import os
import shlex
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from hashlib import sha256
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import torch
import tyro
from tqdm import tqdm

from cfnav_core.benchmark.grid import Local, ended_by_signals, run_tasks
from cfnav_core.benchmark.jobs import Job, Places, Variant
from cfnav_core.benchmark.pages import change, spread
from cfnav_core.benchmark.presets import PresetName
from cfnav_core.benchmark.rows import DRIVEN, GIVEN, NAMES, STUDIED, Schedule, Split
from cfnav_core.benchmark.stamps import Made, check_rooms, identity_of_rooms
from cfnav_core.benchmark.statistics import interval, over_seeds
from cfnav_core.benchmark.tested import Tested, save
from cfnav_core.benchmark.work import Task
from cfnav_core.config import PUBLISHED, MethodName, ModelName, PHat, TrainOptions
from cfnav_core.evaluate import evaluate
from cfnav_core.run_files import BEST
from cfnav_core.whole import write_file

EPISODES_SEED = 2
"""Of the episodes here; others chose the checkpoints."""


@dataclass(frozen=True)
class Way:
    """A way for p_hat to enter.

    Attributes:
        name: in words. method: of training. variant: of it.
    """

    name: str
    method: MethodName
    variant: Variant = ""


PLAIN = Way("plain", "plain")
SCALAR = Way("ours: one number of the LSTM's input", "ours")
LOGITS = Way("ours, also added to the action logits", "ours", "listening")
TOLD = Way("told the true flag in training", "truth")
DROPPED = Way(f"ours, dropout {PUBLISHED.dropout} on picture features", "ours", "dropout")

STUDIES: dict[tuple[ModelName, Split], tuple[Way, ...]] = {
    DRIVEN: (PLAIN, SCALAR, LOGITS, TOLD),
    STUDIED: (PLAIN, SCALAR, LOGITS, DROPPED, TOLD),
}
"""TDANet-style reads no picture features, L-sTDE does."""

ASKED: tuple[PHat, ...] = ("own", *GIVEN)


@dataclass(frozen=True)
class Study:
    """Study how p_hat should enter; trains what is missing and goes on where it was stopped."""

    scenes: Path = Path("out/paper/rooms")
    """All built-in rooms, the validation rooms with scans and LiDAR states."""
    grid: Path = Path("out/paper/grid")
    """Folder of a grid (cfnav benchmark), which gets the runs that it lacks."""
    results: Path = Path("out/paper/results")
    """Folder that gets p_hat.md and p_hat.json; their names also bear the model where only one was
    asked for, and schedule and first seed where these are not the usual one and 0:
    p_hat_tdanet_tenfold_from_seed3.md."""
    seeds: int = 5
    """Of each row."""
    first_seed: int = 0
    """The others follow it."""
    episodes: int = 2_000
    """Of each seed."""
    jobs: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Processes side by side."""
    model: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """Only this model, given as often as needed."""
    preset: PresetName = "small"
    """That of the grid."""
    schedule: Schedule = "usual"
    """Of training."""


@dataclass(frozen=True)
class Line:
    """A row of the study: shares of 1.

    Attributes:
        cf_sr_mean, cf_sr_std: over seeds, std None for one seed.
        commit: of the code that trained it.
        over_plain: CF-SR minus plain's; over_scalar: minus that of ``SCALAR`` given the same p_hat.
            Both with 95 % intervals over seeds and rooms.
    """

    split: str
    model: str
    variant: str
    p_hat: str
    commit: str
    cf_sr_mean: float
    cf_sr_std: float | None
    over_plain: float | None
    over_plain_ci95: tuple[float, float] | None
    over_scalar: float | None
    over_scalar_ci95: tuple[float, float] | None


def run(study: Study) -> None:
    """Train, evaluate and write.

    Raises:
        ValueError: the grid has not trained what is compared, training failed, or a model is none
            of the study.
        SceneError: the scenes cannot be used, or lack what the LiDAR says.
    """
    if unknown := set(study.model) - {model for model, _ in STUDIES}:
        raise ValueError(
            f"found no study of {', '.join(sorted(unknown))}, expected "
            f"{' or '.join(model for model, _ in STUDIES)}"
        )
    studies = [of for of in STUDIES if not study.model or of[0] in study.model]
    places = Places(study.scenes.resolve(), study.grid.resolve())
    perception = Made.read(study.grid).perception
    runs = {
        (of, way, seed): Job(
            of[0], way.method, of[1], seed, study.preset, perception, study.schedule, way.variant
        )
        for seed in range(study.first_seed, study.first_seed + study.seeds)
        for of in studies
        for way in STUDIES[of]
    }  # fmt: skip
    _train(list(runs.values()), places, study)
    with ProcessPoolExecutor(study.jobs, get_context("spawn"), torch.set_num_threads, (1,)) as pool:
        found = [
            line
            for of in studies
            for line in _lines(
                study, of, {k[1:]: job.options(places) for k, job in runs.items() if k[0] == of},
                pool,
            )
        ]  # fmt: skip
    study.results.mkdir(parents=True, exist_ok=True)
    asked = [model for model, _ in studies] if len(studies) < len(STUDIES) else []
    schedule = [study.schedule] if study.schedule != "usual" else []
    later = [f"from_seed{study.first_seed}"] if study.first_seed else []
    name = "_".join(["p_hat", *asked, *schedule, *later])
    write_file(
        study.results / f"{name}.json",
        json.dumps({"command": shlex.join(["python", "-m", __spec__.name, *sys.argv[1:]]),
                    "schedule": study.schedule, "first_seed": study.first_seed,
                    "seeds": study.seeds, "episodes": study.episodes,
                    "rows": [asdict(line) for line in found]}, indent=1) + "\n",
    )  # fmt: skip
    seeds = ", ".join(str(study.first_seed + n) for n in range(study.seeds))
    page = f"{study.episodes:,} episodes of each training seed ({seeds}).\n\n{as_markdown(found)}"
    write_file(study.results / f"{name}.md", page)
    print(page)


def _train(jobs: Sequence[Job], places: Places, study: Study) -> None:
    """Train the variants that are missing, as a grid does.

    Raises:
        ValueError: what they are compared with was not trained, or training failed.
    """
    tasks = [Task(job, places) for job in jobs]
    for task in tasks:
        tested = any(_tests(study).glob(f"{task.job.name}_*"))
        there = task.result.exists() and ((task.folder / BEST).exists() or tested)
        if not task.job.variant and not there:
            raise ValueError(
                f"found no trained run {task.job.title} with its weights in {study.grid}; run "
                "cfnav benchmark there first"
            )
    variants = [task for task in tasks if task.job.variant]
    missing = [task for task in variants if not task.result.exists()]
    if missing:
        check_rooms(places, tuple(dict.fromkeys(task.job.split for task in missing)))
    sources = [Task(task.job.stage1, places) for task in variants if task.job.stage1]
    run_tasks([*sources, *variants], Local(study.jobs))


def _lines(
    study: Study, of: tuple[ModelName, Split], runs: dict[tuple[Way, int], TrainOptions],
    pool: ProcessPoolExecutor,
) -> list[Line]:  # fmt: skip
    model, split = of
    tests = [
        (way, p_hat) for way in STUDIES[of] for p_hat in (ASKED if way is not PLAIN else ("own",))
    ]
    seeds = range(study.first_seed, study.first_seed + study.seeds)
    asked = [(runs[way, seed].out / BEST, p_hat) for way, p_hat in tests for seed in seeds]
    test = partial(_tested, study, split, identity_of_rooms(study.scenes, f"{split}:validation"))
    tested = [
        Tested.load(path)
        for path in tqdm(pool.map(test, *zip(*asked, strict=True)), NAMES[model], len(asked))
    ]
    rates, rooms = [of.cf_success for of in tested], tested[0].rooms
    by_test = dict(zip(tests, np.reshape(rates, (len(tests), study.seeds, -1)), strict=True))
    lines = []
    for n, ((way, p_hat), rate) in enumerate(by_test.items()):
        mean, std = over_seeds(rate)
        trained_at = {of.commit for of in tested[n * study.seeds : (n + 1) * study.seeds]}
        plain = None if way is PLAIN else rate - by_test[PLAIN, "own"]
        scalar = None if way in (PLAIN, SCALAR) else rate - by_test[SCALAR, p_hat]
        lines.append(Line(
            split, NAMES[model], way.name, GIVEN.get(p_hat, "its own"),
            ", ".join(sorted(trained_at)), mean, std if study.seeds > 1 else None,
            *_compared(plain, rooms), *_compared(scalar, rooms),
        ))  # fmt: skip
    return lines


def _tests(study: Study) -> Path:
    """Folder of the tests, which an archive of results may have brought."""
    return study.grid / "p_hat" / "tests"


def _tested(study: Study, split: Split, made_of: str, best: Path, p_hat: PHat) -> Path:
    """The file of a run's results, tested if it is not there.

    Raises:
        ValueError: it is not there, and neither are the weights.
    """
    rest = f"{study.episodes}_{p_hat}_{made_of}.npz"
    if not best.exists():
        recorded = sorted(_tests(study).glob(f"{best.parent.name}_????????_{rest}"))
        if len(recorded) != 1:
            raise ValueError(
                f"found no weights in {best.parent} and {len(recorded)} tests of them with "
                f"{p_hat} p_hat, expected one; train that run again, or unpack its archive"
            )
        return recorded[0]
    weights = sha256(best.read_bytes()).hexdigest()[:8]
    path = _tests(study) / f"{best.parent.name}_{weights}_{rest}"
    if not path.exists():
        found = evaluate(
            best, study.scenes, study.episodes, EPISODES_SEED, p_hat=p_hat,
            rooms=(f"{split}:validation",),
        )  # fmt: skip
        path.parent.mkdir(parents=True, exist_ok=True)
        save(replace(found, trace=[]), path)
    return path


def _compared(
    difference: np.ndarray | None, rooms: np.ndarray
) -> tuple[float, tuple[float, float]] | tuple[None, None]:
    if difference is None:
        return None, None
    return float(difference.mean()), interval(difference, rooms)


def as_markdown(lines: Sequence[Line]) -> str:
    """A table for people, percent."""
    rows = [
        "| data | model | p_hat enters | p_hat | CF-SR | over plain [95 %] "
        "| over one number [95 %] |",
        "|" + "---|" * 7,
    ]
    for line in lines:
        cells = (
            line.split, line.model, line.variant, "" if line.variant == PLAIN.name else line.p_hat,
            spread(line.cf_sr_mean, line.cf_sr_std), change(line.over_plain, line.over_plain_ci95),
            change(line.over_scalar, line.over_scalar_ci95),
        )  # fmt: skip
        rows.append("| " + " | ".join(cells) + " |")
    return "\n".join(rows) + "\n"


def main() -> None:
    """Entry point; what was found wrong is one sentence."""
    try:
        with ended_by_signals():
            run(tyro.cli(Study, prog="p_hat_study"))
    except (ValueError, OSError) as error:
        sys.exit(f"p_hat_study: {error}")


if __name__ == "__main__":
    main()
