"""What more training rooms are worth: ``python -m studies.worlds.room_curve --scenes DIR``.

One method learns in more and more rooms: each set holds the smaller ones, and as many rooms of each
type and furniture. Everything else is the same, the number of episodes too. Policies are judged in
validation rooms that did not choose their checkpoints, and in the rooms that all have learned in;
the distance of the two is how far they overfit. Test rooms stay sealed.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from cfnav_core.agent.config import RunConfig, TrainOptions
from cfnav_core.command import command_line, run_options
from cfnav_core.files.json_lines import append_row, read_rows, write_rows
from cfnav_core.files.locks import locked
from cfnav_core.files.provenance import commit
from cfnav_core.files.whole import write_file
from cfnav_core.learn.evaluate import Evaluation, evaluate
from cfnav_core.learn.stage_one import predictor_figures
from cfnav_core.learn.train import train
from cfnav_core.task.intervals import ends_text
from cfnav_core.task.metrics import figures, paired
from cfnav_core.task.rooms import (
    BUILT_IN,
    FIRST_OF_PERCEPTION,
    SPLITS,
    SWEET_HOME,
    is_test_room,
    of_furniture,
)
from cfnav_core.task.vocabulary import ROOM_TYPES
from studies.engine.pages import Cell, change, percent, table
from studies.engine.pictures import COLOURS, CURVES, save_picture

SPLIT = "worlds"
VALIDATION = SPLITS[SPLIT]["validation"]
CHOOSE = 2
"""Of these seeds, so many choose checkpoints; the others judge."""
LEARNT_BY = {*SPLITS[SPLIT]["train"], *VALIDATION[:CHOOSE]}
KINDS = tuple(of_furniture(kind, name) for kind in ROOM_TYPES for name in (BUILT_IN, SWEET_HOME))


@dataclass(frozen=True)
class RoomCurve:
    """Train in more and more rooms, and judge each policy in rooms that it has not learned in.

    Writes room_curve.jsonl, a line for each policy as soon as it is judged, room_curve.md and
    room_curve.png. Goes on where it stopped.
    """

    scenes: Path
    """Folder of the scenes (cfnav rooms make --rooms worlds:train ...), of both furnitures."""
    out: Path = Path("out/room_curve")
    """Folder of the runs and of what came of them."""
    counts: tuple[int, ...] = (64, 128, 256, 512, 1000)
    """Numbers of training rooms, as many of each type and furniture."""
    seeds: tuple[int, ...] = (0,)
    """Training seeds."""
    run: RunConfig = field(default_factory=RunConfig)
    """What is trained; each of its runs has a seed of ``seeds``."""
    validation_every: int = 15_000
    """Episodes between validations."""
    validation_episodes: int = 600
    """Frozen validation episodes."""
    episodes: int = 2_000
    """Frozen episodes that judge, in new rooms and in the rooms that all know."""
    new: tuple[int, ...] = tuple(VALIDATION[CHOOSE:])
    """Seeds of the rooms that judge, of each type and furniture: none of those that train or choose
    a checkpoint, and none of the sealed ones."""
    threads: int = 1
    """CPU threads."""

    @cached_property
    def places(self) -> dict[str, tuple[str, ...]]:
        """Rooms that judge: those that nobody learns in, and those that everybody does."""
        return {"new": named(self.new), "known": rooms_of(min(self.counts))}

    @property
    def conditions(self) -> dict[str, Any]:
        """What all lines of a file share."""
        run = {**asdict(self.run), "seed": None}
        return {
            "run": run, "episodes": self.episodes, "new": list(self.new),
            "known": list(self.places["known"]),
            "validation": [self.validation_every, self.validation_episodes],
        }  # fmt: skip


def rooms_of(count: int) -> tuple[str, ...]:
    """Name so many training rooms: the first ones of each type and furniture.

    Raises:
        ValueError: they cannot be as many of each, or there are not so many.
    """
    seeds = SPLITS[SPLIT]["train"]
    each, rest = divmod(count, len(KINDS))
    if rest or not 0 < each <= len(seeds):
        raise ValueError(
            f"found {count} training rooms, expected a multiple of {len(KINDS)} (types and "
            f"furnitures) up to {len(seeds) * len(KINDS)}"
        )
    return named(seeds[:each])


def named(seeds: Sequence[int]) -> tuple[str, ...]:
    """Rooms of some seeds, of each type and furniture."""
    return tuple(f"{kind}:{seed}" for kind in KINDS for seed in seeds)


def _is_new(seed: int) -> bool:
    """Whether no policy and no perception learnt from a seed's rooms, and none is sealed."""
    sealed = any(is_test_room(kind, seed) for kind in KINDS)
    return seed not in LEARNT_BY and seed < FIRST_OF_PERCEPTION and not sealed


def measure(study: RoomCurve) -> list[dict[str, Any]]:
    """Train and judge what is missing; returns all lines.

    Raises:
        OSError: the file of results cannot be read or written, or holds others.
        SceneError: the scenes cannot be used.
        ValueError: the counts make no sense, or rooms that judge are not new.
    """
    path = study.out / "room_curve.jsonl"
    known = sorted(seed for seed in study.new if not _is_new(seed))
    if known or not study.new:
        raise ValueError(
            f"found --new {' '.join(map(str, known)) or 'without a seed'}, expected seeds of rooms "
            "that neither train, nor choose a checkpoint, nor are sealed, such as 232 to 299"
        )
    training = {count: rooms_of(count) for count in sorted(study.counts)}
    study.out.mkdir(parents=True, exist_ok=True)
    with locked(study.out / "lock"):
        rows = read_rows(path)
        for row in rows:
            if row["conditions"] != study.conditions:
                raise OSError(
                    f"found lines of other conditions in {path} ({row['conditions']}), expected "
                    f"{study.conditions}; choose another --out"
                )
        write_rows(path, rows)
        there = {(row["rooms"], row["seed"]) for row in rows}
        for seed in study.seeds:
            for count, rooms in training.items():
                if (count, seed) not in there:
                    rows.append(_point(study, count, rooms, seed))
                    append_row(path, rows[-1])
    return rows


def _point(study: RoomCurve, count: int, rooms: tuple[str, ...], seed: int) -> dict[str, Any]:
    """Train in some rooms and judge."""
    folder = study.out / f"rooms_{count}" / f"seed_{seed}"
    best = train(
        TrainOptions(
            study.scenes, rooms, named(VALIDATION[:CHOOSE]), folder,
            run=RunConfig.read(asdict(study.run) | {"seed": seed}),
            validation_every=study.validation_every,
            validation_episodes=study.validation_episodes, threads=study.threads,
        )
    )  # fmt: skip
    found = {
        place: _judged(evaluate(best, study.scenes, study.episodes, 0, rooms=where))
        for place, where in study.places.items()
    }
    return {
        "rooms": count, "seed": seed, "conditions": study.conditions, "commit": commit(), **found
    }  # fmt: skip


def _judged(evaluation: Evaluation) -> dict[str, Any]:
    """Figures of all episodes and of each furniture, and what became of each episode."""
    rooms = evaluation.rooms
    sweet = np.char.startswith(rooms, SWEET_HOME)
    results = evaluation.results
    found = figures(results, rooms)
    quality = predictor_figures(evaluation.bank, evaluation.trace)
    return {
        "sr": found["sr"],
        "cf_sr": found["cf_sr"],
        "cf_sr_interval": list(found["cf_sr_interval"] or ()) or None,
        "by_furniture": {
            name: float(np.mean([r.cf_success for r, c in zip(results, of, strict=True) if c]))
            for name, of in ((BUILT_IN, ~sweet), (SWEET_HOME, sweet))
        },
        "predictor_auc": quality.get("predictor_auc"),
        "episodes": evaluation.episodes.identity(evaluation.bank),
        "scenes": [evaluation.bank.perception, *sorted({s.source for s in evaluation.bank.scenes})],
        "cf_success": [int(r.cf_success) for r in results],
        "in_room": rooms.tolist(),
    }


def gains(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """CF-SR in new rooms of each number of rooms minus that of the next smaller, by seed.

    Returns:
        ``paired``'s figures with ``rooms`` and ``seed``; none for the smallest. The interval is
        over rooms, of one run each.

    Raises:
        ValueError: the episodes differ, as the scenes were made anew between two runs.
    """
    found = []
    for seed in sorted({row["seed"] for row in rows}):
        of = sorted((row for row in rows if row["seed"] == seed), key=lambda row: row["rooms"])
        for fewer, more in pairwise(of):
            for key in ("episodes", "scenes"):  # perception and version change no episode
                if more["new"].get(key) != fewer["new"].get(key):
                    raise ValueError(
                        f"found other {key} for {more['rooms']} rooms than for {fewer['rooms']}: "
                        "they were made anew; choose another --out and measure both again"
                    )
            a, b = (np.array(row["new"]["cf_success"], bool) for row in (more, fewer))
            difference = paired(a, b, np.array(more["new"]["in_room"]))
            found.append({"rooms": more["rooms"], "seed": seed, **difference})
    return found


def as_markdown(rows: Sequence[Mapping[str, Any]]) -> str:
    """A line for each policy."""
    gained = {(g["rooms"], g["seed"]): g for g in gains(rows)}

    def gain(row: Mapping[str, Any]) -> str:
        found = gained.get((row["rooms"], row["seed"]))
        return change(found["cf_sr_difference"], found["interval"]) if found else ""

    columns: dict[str, Cell] = {
        "training rooms": lambda row: str(row["rooms"]),
        "seed": lambda row: str(row["seed"]),
        "CF-SR, new rooms": lambda row: (
            f"{row['new']['cf_sr']:.3f} {ends_text(row['new']['cf_sr_interval'])}"
        ),
        "over fewer rooms [95 % over rooms, one run each], points": gain,
        "built in, %": lambda row: percent(row["new"]["by_furniture"][BUILT_IN]),
        "Sweet Home, %": lambda row: percent(row["new"]["by_furniture"][SWEET_HOME]),
        "known rooms, %": lambda row: percent(row["known"]["cf_sr"]),
        "AUC of p̂, new rooms": lambda row: (
            "" if row["new"]["predictor_auc"] is None else f"{row['new']['predictor_auc']:.3f}"
        ),
    }
    return table(columns, sorted(rows, key=lambda row: (row["rooms"], row["seed"])))


def draw(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Draw CF-SR over the number of rooms, a mark for each seed and a line through their means.

    Raises:
        WriteError: the picture cannot be written.
    """
    curves = {
        "rooms that all learned in": lambda row: row["known"]["cf_sr"],
        "new rooms": lambda row: row["new"]["cf_sr"],
        "new, our furniture": lambda row: row["new"]["by_furniture"][BUILT_IN],
        "new, Sweet Home": lambda row: row["new"]["by_furniture"][SWEET_HOME],
    }
    counts = sorted({row["rooms"] for row in rows})
    seeds = Counter(row["seed"] for row in rows)
    whole = [row for row in rows if seeds[row["seed"]] == len(counts)] or rows
    with mpl.rc_context(CURVES):
        figure = Figure(figsize=(6.5, 3.8), layout="constrained")
        ax = figure.subplots()
        for (name, value), colour in zip(curves.items(), COLOURS, strict=False):
            means = [np.mean([value(row) for row in whole if row["rooms"] == n]) for n in counts]
            ax.plot(counts, np.multiply(100, means), "-", color=colour, label=name)
            marks = np.array([(row["rooms"], 100 * value(row)) for row in rows])
            ax.plot(*marks.T, "o", color=colour, ms=4)
        ax.set_xscale("log", base=2)
        ax.set_xticks(counts, [str(n) for n in counts], minor=False)
        ax.set(xlabel="training rooms", ylabel="CF-SR, %")
        ax.legend(frameon=False, fontsize=8)
        save_picture(figure, path)


def main(study: RoomCurve) -> None:
    """Make the study, write and print."""
    rows = measure(study)
    text = as_markdown(rows)
    commits = ", ".join(sorted({row["commit"] for row in rows}))
    write_file(study.out / "room_curve.md", f"{text}\n`{command_line()}`, commit {commits}.\n")
    draw(rows, study.out / "room_curve.png")
    print(text)


if __name__ == "__main__":
    sys.exit(run_options("room_curve", RoomCurve, main))
