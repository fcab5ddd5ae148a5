"""Table IV over the live graph: ``python -m cfnav_ros.trials table-iv``.

The paper drove a TurtleBot 4 through three rooms. Here the mock drives through three furnished
rooms in which nothing was trained, chosen or tested before, by another light and through another
lens than in training (``sim_bridge.visual_shift``), with its noise; the LiDAR gives p_hat and has
no veto, as in the paper. Rows of our own follow.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tyro

from cfnav_core.benchmark.jobs import Job
from cfnav_core.benchmark.pages import Figures, write_tables
from cfnav_core.benchmark.rows import DRIVEN, Schedule
from cfnav_core.benchmark.statistics import interval_of_trials, over_seeds
from cfnav_core.bundle import BundleError, BundleHead
from cfnav_core.locks import locked
from cfnav_core.source import commit
from cfnav_core.whole import whole, write_file, writing
from cfnav_ros.demo import run_trial
from cfnav_ros.identities import identity_of, world_source
from cfnav_ros.json_lines import append_row, read_rows, write_rows
from cfnav_ros.plan import Trial
from cfnav_ros.table_iv_rows import GOALS, PAPERS, PLACES, ROWS, SOURCES, TRIALS, Way, trials_of


@dataclass(frozen=True)
class TableIV:
    """Drive Table IV: 15 trials a method as in the paper, or more over several training seeds."""

    bundles: Path = Path("out/paper/bundles")
    """Folder of bundles METHOD_seedN, or METHOD_SCHEDULE_seedN where it is not the usual one: of
    plain, reward_only, stage_only, ours and truth."""
    schedule: Schedule = "usual"
    """How long the policies were trained; tenfold: with ten times as many episodes in stage two."""
    trials: int = TRIALS
    """Of each row."""
    seeds: int = 1
    """Training seeds that share the trials."""
    first_seed: int = 0
    """The others follow it."""
    rows: Literal["paper", "sources", "main", "all"] = "all"
    """The paper's; or plain, and ours with the LiDAR's, RGB's and the larger p_hat; or the paper's,
    the method Truth, and ours with RGB, zero, shuffled or the truth for the LiDAR's p_hat; or also
    drawn actions, the larger of LiDAR and RGB, veto, no visual shift."""
    only: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """Only these rows, by the method's name, given as often as needed; writes no table."""
    out: Path = Path("out/paper/trials")
    """Folder of what was driven; episodes in it are not driven again."""
    results: Path | None = None
    """Folder of the tables and figures; that of what was driven when absent."""
    speed: float = 0.0
    """Simulated seconds per second; 0 is as fast as the machine can."""
    domain: Annotated[int | None, tyro.conf.arg(metavar="ID")] = None
    """ROS domain; one that is free when not given."""


def run(config: TableIV) -> None:
    """Drive what is missing; then write and print the table and draw its figure.

    Raises:
        BundleError: a bundle cannot be used.
        GraphError: the graph did not run.
        ValueError: trials that the seeds cannot share.
        OSError: results cannot be read or written.
    """
    if config.trials % config.seeds:
        raise ValueError(
            f"found {config.trials} trials for {config.seeds} seeds; expected a multiple"
        )
    ways = ROWS[config.rows]
    if unknown := set(config.only) - {way.method for way in ways}:
        raise ValueError(f"found no row of {', '.join(sorted(unknown))} in Table IV")
    asked = [
        (way, seed)
        for way in ways if not config.only or way.method in config.only
        for seed in _seeds(config)
    ]  # fmt: skip
    for way, seed in [drive for drive in asked if _missing(config, *drive)]:
        config.out.mkdir(parents=True, exist_ok=True)
        with locked(_file(config, way, seed).with_suffix(".lock")):
            _drive(config, way, seed)
    if not config.only:
        _write(config, ways)


def _seeds(config: TableIV) -> range:
    return range(config.first_seed, config.first_seed + config.seeds)


def _bundle(config: TableIV, way: Way, seed: int) -> Path:
    return config.bundles / f"{way.method}{_trained(config)}_seed{seed}"


def _file(config: TableIV, way: Way, seed: int) -> Path:
    each = config.trials // config.seeds
    return config.out / f"{way.key}{_trained(config)}_seed{seed}_{each}.jsonl"


def _trained(config: TableIV, before: str = "_") -> str:
    return "" if config.schedule == "usual" else before + config.schedule


def _from(config: TableIV, before: str) -> str:
    return f"{before}{config.first_seed}" if config.first_seed else ""


def _missing(config: TableIV, way: Way, seed: int) -> list[Trial]:
    """The trials of a row and a training seed that were not driven yet.

    Its bundle is needed only when there are any.
    """
    path, bundle = _file(config, way, seed), _bundle(config, way, seed)
    rows = read_rows(path)
    there = {Trial(**row["trial"]) for row in rows}
    missing = [t for t in trials_of(config.trials // config.seeds, seed) if t not in there]
    if missing and any(row["world"] != world_source() for row in rows):
        raise OSError(f"{path} holds trials in another version of the simulator; remove it")
    if missing:
        _check_training(bundle, way, seed, config.schedule)
    if missing or bundle.exists():
        other = {row["bundle"] for row in rows} - {identity_of(bundle)}
        if other:
            raise OSError(f"{path} holds trials of another bundle ({other.pop()}); remove it")
    return missing


def _check_training(bundle: Path, way: Way, seed: int, schedule: Schedule) -> None:
    """See that a bundle of a preset's run is of the run that its folder's name says.

    Raises:
        BundleError: it is of another.
    """
    job = Job.of(BundleHead.load(bundle).training)
    if job is None:
        return
    model, split = DRIVEN
    asked = Job(model, way.method, split, seed, job.preset, job.perception, schedule)
    if (job.split, job.config) != (split, asked.config):
        raise BundleError(
            f"found the bundle of {job.title} in {bundle}, expected {asked.title}; export that run"
        )


def _drive(config: TableIV, way: Way, seed: int) -> None:
    """Drive what is missing of a row and a training seed, and add it to its file."""
    # here, so that the command answers at once to --help and to arguments that make no sense
    from cfnav_ros.graph import Graph, GraphConfig

    missing = _missing(config, way, seed)
    if not missing:
        return
    path, bundle = _file(config, way, seed), _bundle(config, way, seed)
    there = read_rows(path)
    write_rows(path, there)
    said = {"bundle": identity_of(bundle), "run": run_of(bundle), "commit": commit()}
    said["world"] = world_source()
    print(f"{way.name}, training seed {seed}: {len(missing)} trials", flush=True)
    graph_config = GraphConfig(
        room=missing[0].room, logs=config.out / "logs" / path.stem, speed=config.speed,
        bundle=bundle, veto=way.veto, domain=config.domain, lock_step=True, p_hat=way.p_hat,
        # drives that go on do not draw the numbers of those before them again
        sample_seed=1000 * seed + len(there) if way.sample else None,
        visual_shift=way.visual_shift, track=True,
    )  # fmt: skip
    with Graph(graph_config) as graph:
        for trial in missing:
            start = graph.start_episode(trial.room, trial.goal, trial.seed)
            if not start.ok:
                raise OSError(start.message)
            outcome = run_trial(graph, trial)
            if graph.map is not None:
                _keep_map(config.out, trial.room, graph.map)
            track = [(round(x, 3), round(y, 3), n) for x, y, n in graph.track]
            append_row(path, {"trial": asdict(trial), **said, **asdict(outcome), "track": track})


def run_of(bundle: Path) -> dict[str, str]:
    """The training run that a bundle came from.

    Returns:
        preset and config_hash, empty when it is that of no preset, and the code's commit.
    """
    training = BundleHead.load(bundle).training
    job = Job.of(training)
    return {
        "preset": job.preset if job else "", "config_hash": job.hash if job else "",
        "commit": training.get("commit", "unknown"),
    }  # fmt: skip


def _keep_map(out: Path, room: str, message: Any) -> None:
    """Keep the map of a room, for the figure."""
    path = out / "maps" / f"{room.replace(':', '_')}.npz"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        info = message.info
        cells = np.array(message.data, np.int8).reshape(info.height, info.width)
        with writing(path), whole(path) as partial, partial.open("wb") as file:
            np.savez_compressed(file, occupied=cells > 0, resolution=info.resolution)


def _write(config: TableIV, ways: Sequence[Way]) -> None:
    """Write and print the table and draw the paths of the first trial of each goal."""
    # matplotlib is slow to import
    from cfnav_ros.table_iv_plot import draw_table_iv

    driven = {way: [_driven(config, way, seed) for seed in _seeds(config)] for way in ways}
    worlds = {row["world"] for of in driven.values() for rows in of for row in rows}
    if len(worlds) > 1:
        raise OSError(
            f"found trials in {len(worlds)} versions of the simulator in {config.out}, which "
            f"do not compare; remove those whose world is not {world_source()}"
        )
    results = config.results or config.out
    write_tables([_figures(config, way, driven) for way in ways], results)
    # of the last seed; the first goal in the first room, the second in the second, and so on
    shown = SOURCES if config.rows == "sources" else PAPERS
    first = {way.name: driven[way][-1][: 3 * len(GOALS) : 4] for way in shown}
    title = f"One trial of each goal by training seed {_seeds(config)[-1]}"
    title += _trained(config, ", trained ")
    picture = draw_table_iv(first, config.out / "maps", PLACES, title)
    of = f"{config.trials}{'_sources' if shown is SOURCES else ''}"
    of += f"{_trained(config)}{_from(config, '_from_seed')}"
    write_file(results / f"table_IV_{of}.png", picture)


def _figures(config: TableIV, way: Way, driven: dict[Way, list[list[dict[str, Any]]]]) -> Figures:
    """A row of the table.

    Gains are over the plain model, "over own p_hat" over the same bundles with the RGB predictor,
    and "ours minus it" is of ours with the LiDAR; all under the same visual shift, with actions
    chosen alike and without a veto.
    """
    rows = driven[way]
    collisions, outcomes = (
        np.array([[row[name] for row in of_seed] for of_seed in rows])
        for name in ("collisions", "outcome")
    )
    free = {(w.method, w.p_hat, w.visual_shift, w.sample): w for w in driven if not w.veto}
    plain = free["plain", "lidar", way.visual_shift, way.sample]
    own = free.get((way.method, "own", way.visual_shift, way.sample))
    ours = free["ours", "lidar", way.visual_shift, way.sample]
    cf_success, success = (_rates(rows, name) for name in ("cf_success", "success"))
    cf_spl = np.array([[_cf_efficiency(row) for row in of_seed] for of_seed in rows])
    compared: dict[str, Any] = {}
    if way is not plain:
        compared |= _difference("gain", driven, way, plain, "cf_success")
        compared |= _difference("sr_gain", driven, way, plain, "success")
        by_seed = (cf_success - _rates(driven[plain], "cf_success")).mean(1)
        compared["gain_by_seed"] = tuple(by_seed.round(4).tolist())
    if own and way is not own:
        compared |= _difference("over_own", driven, way, own, "cf_success")
    if way.method != "ours" and way is not plain:
        compared |= _difference("ours_over", driven, ours, way, "cf_success")
    runs = [of_seed[0]["run"] for of_seed in rows]
    cf_sr, spl = over_seeds(cf_success), over_seeds(cf_spl)
    commits = sorted({row["commit"] for of_seed in rows for row in of_seed})
    return Figures(
        table="IV", row=way.name, model=DRIVEN[0], method=way.method,
        split=f"{config.trials} live trials{_trained(config, ', ')}{_from(config, ', from seed ')}",
        p_hat=way.p_hat, veto=way.veto, sample=way.sample, preset=runs[0]["preset"],
        paper_cf_sr=None if way.paper is None else round(way.paper / TRIALS, 3),
        paper_gain=None if not way.paper else round(way.paper / TRIALS, 3),
        cf_sr_mean=cf_sr[0], cf_sr_std=None if config.seeds < 2 else cf_sr[1],
        cf_spl_mean=spl[0], cf_spl_std=None if config.seeds < 2 else spl[1],
        sr_mean=float(success.mean()),
        collisions_mean=float(collisions.mean()),
        touched_mean=float((collisions > 0).mean()),
        aborted_mean=float((outcomes == "aborted").mean()),
        seeds=config.seeds, episodes=len(rows[0]), **compared,
        command=shlex.join(["python", "-m", "cfnav_ros.trials", *sys.argv[1:]]),
        config_hash=runs[0]["config_hash"],
        commit=", ".join(sorted({run["commit"] for run in runs})), tested_at=", ".join(commits),
    )  # fmt: skip


def _driven(config: TableIV, way: Way, seed: int) -> list[dict[str, Any]]:
    """Its trials in the order of ``trials_of``, so that those of two rows are pairs."""
    rows = read_rows(_file(config, way, seed))
    by_trial = {Trial(**row["trial"]): row for row in rows}
    return [by_trial[trial] for trial in trials_of(config.trials // config.seeds, seed)]


def _difference(
    name: str, driven: dict[Way, list[list[dict[str, Any]]]], way: Way, other: Way, rate: str
) -> dict[str, Any]:
    """A field of ``Figures`` that compares two rows, and its interval."""
    found = _rates(driven[way], rate) - _rates(driven[other], rate)
    rooms = np.array([row["room"] for row in driven[way][0]])
    # trials that all ended alike say nothing of how far others may differ
    ends = interval_of_trials(found, rooms) if found.any() else None
    return {name: float(found.mean()), f"{name}_ci95": ends}


def _rates(rows: Sequence[Sequence[dict[str, Any]]], name: str) -> np.ndarray:
    """float64 [seeds, N]."""
    return np.array([[row[name] for row in of_seed] for of_seed in rows], float)


def _cf_efficiency(row: dict[str, Any]) -> float:
    """The term of CF-SPL, path lengths in metres."""
    if not row["cf_success"]:
        return 0.0
    shortest = row["shortest_path_m"]
    return float(shortest / max(row["path_length_m"], shortest))
