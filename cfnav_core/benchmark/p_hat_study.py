"""How p_hat should enter: ``python -m cfnav_core.benchmark.p_hat_study``, in validation rooms.

The paper feeds one number and does not say where. Here the methods of a grid stand beside variants
of ours that it lacks, each given other probabilities. It chose nothing: no test room is looked at,
and no table of the paper has these variants.
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

from cfnav_core.benchmark.jobs import Job, Places
from cfnav_core.benchmark.pages import change, spread
from cfnav_core.benchmark.presets import PresetName
from cfnav_core.benchmark.rows import DRIVEN, GIVEN, NAMES, STUDIED, Schedule, Split
from cfnav_core.benchmark.stamps import Made, identity_of
from cfnav_core.benchmark.statistics import interval, over_seeds
from cfnav_core.benchmark.tested import Tested, save
from cfnav_core.benchmark.work import DONE
from cfnav_core.config import MethodName, ModelName, PHat, RunConfig, TrainOptions
from cfnav_core.evaluate import evaluate
from cfnav_core.json_file import write_json
from cfnav_core.run_files import BEST
from cfnav_core.source import commit
from cfnav_core.train import train
from cfnav_core.whole import write_file

DROPOUT = 0.25
"""Of the published networks; the small ones have none."""

EPISODES_SEED = 2
"""Of the episodes here; others chose the checkpoints."""


@dataclass(frozen=True)
class Variant:
    """A way for p_hat to enter.

    Attributes:
        name: in words. method: of training.
        listening: see ``RunConfig``. dropout: of picture features; the model must read such.
    """

    name: str
    method: MethodName
    listening: bool = False
    dropout: float = 0.0

    @property
    def new(self) -> bool:
        """Whether no grid has trained it."""
        return self.listening or self.dropout > 0

    def config(self, run: RunConfig) -> RunConfig:
        """A grid's run as this variant."""
        size = replace(run.size, dropout=self.dropout)
        return replace(run, listening=self.listening, size=size)


PLAIN = Variant("plain", "plain")
SCALAR = Variant("ours: one number of the LSTM's input", "ours")
LOGITS = Variant("ours, also added to the action logits", "ours", listening=True)
TOLD = Variant("told the true flag in training", "truth")
DROPPED = Variant(f"ours, dropout {DROPOUT} on picture features", "ours", dropout=DROPOUT)

STUDIES: dict[tuple[ModelName, Split], tuple[Variant, ...]] = {
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
    """Folder of a grid (cfnav benchmark); new runs lie in its folder p_hat."""
    results: Path = Path("out/paper/results")
    """Folder that gets p_hat.md and p_hat.json."""
    seeds: int = 3
    """Of each row."""
    episodes: int = 2_000
    """Of each seed."""
    jobs: int = field(default_factory=lambda: os.cpu_count() or 1)
    """Processes side by side."""
    model: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """Only this model, given as often as needed."""
    preset: PresetName = "small"
    """That of the grid."""
    schedule: Schedule = "usual"
    """Of training; the files of another than the usual one bear its name, as p_hat_tenfold.md."""


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
        ValueError: the grid has not trained what is compared.
        SceneError: the scenes cannot be used, or lack what the LiDAR says.
    """
    studies = [of for of in STUDIES if not study.model or of[0] in study.model]
    runs = {
        (of, variant, seed): _options(study, *of, variant, seed)
        for seed in range(study.seeds)
        for of in studies
        for variant in STUDIES[of]
    }
    with ProcessPoolExecutor(study.jobs, get_context("spawn"), torch.set_num_threads, (1,)) as pool:
        new = [options for (_, variant, _), options in runs.items() if variant.new]
        for best in pool.map(_trained, new):
            print(f"trained: {best.parent.name}", flush=True)
        found = [
            line
            for of in studies
            for line in _lines(study, of, {k[1:]: o for k, o in runs.items() if k[0] == of}, pool)
        ]
    study.results.mkdir(parents=True, exist_ok=True)
    name = "p_hat" if study.schedule == "usual" else f"p_hat_{study.schedule}"
    write_file(
        study.results / f"{name}.json",
        json.dumps({"command": shlex.join(["python", "-m", __spec__.name, *sys.argv[1:]]),
                    "schedule": study.schedule, "seeds": study.seeds, "episodes": study.episodes,
                    "rows": [asdict(line) for line in found]}, indent=1) + "\n",
    )  # fmt: skip
    page = as_markdown(found)
    write_file(study.results / f"{name}.md", page)
    print(page)


def _options(
    study: Study, model: ModelName, split: Split, variant: Variant, seed: int
) -> TrainOptions:
    """How a run is trained."""
    places = Places(study.scenes.resolve(), study.grid.resolve())
    perception = Made.read(study.grid).perception
    job = Job(model, variant.method, split, seed, study.preset, perception, study.schedule)
    options = job.options(places)
    if not variant.new:
        if not (options.out / DONE).exists():
            raise ValueError(
                f"found no trained run {job.title} in {study.grid}; run cfnav benchmark first"
            )
        return options
    config = variant.config(options.run)
    about = json.dumps({"beside": job.hash, "run": asdict(config)}, sort_keys=True)
    what = "listening" if variant.listening else "dropout"
    name = f"{job.title.replace(' ', '_')}_{what}_{sha256(about.encode()).hexdigest()[:12]}"
    # its stage one is its own: weights and random numbers differ from the start
    return replace(options, run=config, stage1=None, out=places.out / "p_hat" / name)


def _trained(options: TrainOptions) -> Path:
    """The best checkpoint of a run, trained if it is not there."""
    best, done = options.out / BEST, options.out / DONE
    if not done.exists():
        train(options)
        write_json(done, {"commit": commit()})
    return best


def _lines(
    study: Study, of: tuple[ModelName, Split], runs: dict[tuple[Variant, int], TrainOptions],
    pool: ProcessPoolExecutor,
) -> list[Line]:  # fmt: skip
    model, split = of
    tests = [
        (variant, p_hat)
        for variant in STUDIES[of]
        for p_hat in (ASKED if variant is not PLAIN else ("own",))
    ]
    asked = [(runs[variant, n].out / BEST, p_hat) for variant, p_hat in tests
             for n in range(study.seeds)]  # fmt: skip
    test = partial(_tested, study, split, identity_of(study.scenes, f"{split}:validation"))
    tested = [
        Tested.load(path)
        for path in tqdm(pool.map(test, *zip(*asked, strict=True)), NAMES[model], len(asked))
    ]
    rates, rooms = [of.cf_success for of in tested], tested[0].rooms
    by_test = dict(zip(tests, np.reshape(rates, (len(tests), study.seeds, -1)), strict=True))
    lines = []
    for n, ((variant, p_hat), rate) in enumerate(by_test.items()):
        mean, std = over_seeds(rate)
        trained_at = {of.commit for of in tested[n * study.seeds : (n + 1) * study.seeds]}
        plain = None if variant is PLAIN else rate - by_test[PLAIN, "own"]
        scalar = None if variant in (PLAIN, SCALAR) else rate - by_test[SCALAR, p_hat]
        lines.append(Line(
            split, NAMES[model], variant.name, GIVEN.get(p_hat, "its own"),
            ", ".join(sorted(trained_at)), mean, std if study.seeds > 1 else None,
            *_compared(plain, rooms), *_compared(scalar, rooms),
        ))  # fmt: skip
    return lines


def _tested(study: Study, split: Split, made_of: str, best: Path, p_hat: PHat) -> Path:
    """The file of a run's results, tested if it is not there."""
    name = f"{best.parent.name}_{study.episodes}_{p_hat}_{made_of}.npz"
    path = study.grid / "p_hat" / "tests" / name
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
        run(tyro.cli(Study, prog="p_hat_study"))
    except (ValueError, OSError) as error:
        sys.exit(f"p_hat_study: {error}")


if __name__ == "__main__":
    main()
