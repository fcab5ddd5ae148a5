"""From the rows of ``cfnav benchmark`` to tested runs and written tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cfnav_core.files.whole import write_file
from cfnav_core.knowledge.command import WORDS, KnowledgeCommand
from cfnav_core.learn.run_files import BEST
from studies.engine.bench import Bench, episodes_of
from studies.engine.grid import executor_of, run_tasks
from studies.engine.jobs import GridFolders, Job
from studies.engine.results import Results, figures_of
from studies.engine.row import Row, Split
from studies.engine.stamps import Made, check_rooms
from studies.engine.work import Task
from studies.paper.chance import figures_of_chance
from studies.paper.command import Benchmark
from studies.paper.curves import Learned, draw_curves, gaps_as_markdown
from studies.paper.paths import draw_paths, find_pairs
from studies.paper.predictor import judge_predictors, write_qualities
from studies.paper.rows import NAMES, PAPER, ROWS, STUDIED
from studies.paper.runs import trained, write_runs
from studies.paper.summary import write_tables

CURVES = ("II", "III", "tenfold")
"""Tables with learning curves, the last with some for each model."""

PATHS = 3
"""Episodes in the path figure."""


def run_benchmark(options: Benchmark, command: str) -> None:
    """Train what is missing, then test it, then write and print the tables.

    Args:
        options: of the command line.
        command: as it was given, for the results.

    Raises:
        ValueError: there is no such row, or tasks failed; one sentence.
    """
    rows = _chosen(options)
    places = GridFolders(options.scenes.resolve(), options.out.resolve())
    splits = tuple(dict.fromkeys(row.split for row in rows))
    made = Made.read(places.out) if options.recorded else _look(options, places, rows, splits)
    seeds = range(options.seeds)
    bench = Bench(places, options.episodes.resolve(), seeds, options.preset, made, command)
    jobs = bench.jobs(rows)
    if not options.recorded:
        _train_and_test(options, jobs, rows, bench)
    if options.train_only:
        return
    found = [figures_of(row, bench, ROWS) for row in rows]
    if "own" in options.tables:
        found += [figures_of_chance(split, bench) for split in splits]
    runs = [trained(job, places) for job in jobs]  # a missing one is said before any table
    qualities = judge_predictors(rows, bench)
    results = options.results or places.out
    write_tables(found, results)
    of_paper = bench.jobs(row for row in rows if row.table in PAPER)
    write_runs(runs, {job.hash for job in of_paper}, results)
    write_qualities(qualities, results)
    draw_figures(rows, bench, results)


def _chosen(options: Benchmark) -> list[Row]:
    rows = [
        row for row in ROWS
        if row.table in options.tables and (not options.model or row.model in options.model)
    ]  # fmt: skip
    if not rows:
        raise ValueError(
            f"found no row of {', '.join(options.model)} in tables {', '.join(options.tables)}; "
            f"expected models among {', '.join(sorted({row.model for row in ROWS}))}"
        )
    return rows


def _look(
    options: Benchmark, places: GridFolders, rows: Sequence[Row], splits: Sequence[Split]
) -> Made:
    """Check and note the rooms, and make what is known of those for training.

    What tests need is missed now rather than after hours of training.
    """
    places.out.mkdir(parents=True, exist_ok=True)
    check_rooms(places, splits)
    for split in splits:
        if not places.knowledge(split).exists():
            KnowledgeCommand(
                places.scenes, places.knowledge(split), (f"{split}:train",), text=WORDS
            ).run_command()
    tested = [] if options.train_only else [row for row in rows if row.reads_lidar]
    made = Made.of(
        places.scenes,
        {split: episodes_of(options.episodes.resolve(), split) for split in splits},
        {row.split for row in tested},
    )
    made.write(places.out)
    return made


def _train_and_test(
    options: Benchmark, jobs: Sequence[Job], rows: Sequence[Row], bench: Bench
) -> None:
    train = [Task(j, bench.places, None, options.device, options.precision) for j in jobs]
    with executor_of(options.jobs, options.ray) as executor:
        run_tasks(train, executor)
        if not options.train_only:
            run_tasks(bench.tests(rows), executor)


def draw_figures(rows: Sequence[Row], bench: Bench, results: Path) -> None:
    """Draw learning curves and paths, as far as their rows are there.

    The paths are of seed 0.
    """
    model, split = STUDIED
    drawn: dict[str, list[Row]] = {}
    for row in rows:
        if row.table in CURVES and row.p_hat == "own" and not (row.veto or row.sample):
            name = row.table if row.table in PAPER else f"{row.table}_{row.model}"
            drawn.setdefault(name, []).append(row)
    for name, of in drawn.items():
        curves = [
            Learned.read(row.name, [bench.job(row, seed) for seed in bench.seeds], bench.places)
            for row in of
        ]
        draw_curves(curves, results / f"curves_{name}.png")
        write_file(results / f"curves_{name}.md", gaps_as_markdown(curves))
    studied = [row for row in rows if (row.model, row.split) == (model, split)]
    ours = next((row for row in studied if row.table in PAPER and row.method == "ours"), None)
    if ours and ours.reference:
        compared = (ours.reference, ours)
        before, after = (bench.job(row, 0).options(bench.places).out / BEST for row in compared)
        if not (before.exists() and after.exists()):
            print("no picture of paths: the weights of seed 0 are not here")
            return
        tested = Results.load(bench.files(ours.reference)[:1]), Results.load(bench.files(ours)[:1])
        frozen = bench.test(ours).frozen
        assert frozen
        pairs = find_pairs(before, after, tested, bench.places.scenes, frozen, PATHS)
        if pairs:
            draw_paths(pairs, (NAMES[model], ours.name), results / "paths.png")
        else:
            print("no picture of paths: seed 0 of ours improved no episode")
