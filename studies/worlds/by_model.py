"""How well goals are found by what stands for them: ``python -m studies.worlds.by_model BUNDLE``.

In rooms of Sweet Home 3D's models a goal may be a model that no other room has, one that training
rooms have too, or a drawing of ours, where there is no model or too few. So rooms with unknown
models are not rooms of unknown models, and what is found less there need not be for that.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from sim_bridge.room.room import Room, room_of
from sim_bridge.sweet_home.table import pieces, shipped_pieces

from cfnav_core.command import command_line, run_options
from cfnav_core.files.json_file import write_json
from cfnav_core.files.provenance import commit
from cfnav_core.learn.evaluate import Evaluation, evaluate
from cfnav_core.task.intervals import ends_text
from cfnav_core.task.metrics import figures
from cfnav_core.task.rooms import CC0, furniture_of
from studies.engine.pages import Cell, table
from studies.engine.policy_in_scenes import PolicyInScenes

UNKNOWN, KNOWN = "models that only test rooms have", "models of training rooms"
DRAWN, SEVERAL = "drawings of ours", "several of these in one room"

COLUMNS: dict[str, Cell] = {
    "what stands for the goal": lambda row: row["kind"],
    "episodes": lambda row: f"{row['episodes']:,}",
    "CF-SR": lambda row: f"{row['cf_sr']:.3f} {ends_text(row['cf_sr_interval'])}",
    "SR": lambda row: f"{row['sr']:.3f}",
    "goals, most frequent first": lambda row: ", ".join(row["goals"]),
}


@dataclass(frozen=True)
class ByModelOptions(PolicyInScenes):
    """Tell apart how well known and unknown models are found."""

    rooms: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ("sweet_home.worlds:test",)
    """Rooms of Sweet Home 3D's models."""
    p_hat: str = "own"
    """As for cfnav evaluate."""
    json: Path | None = None
    """Also write every figure here."""


@cache
def held_out_models(furniture: str) -> frozenset[str]:
    """Models that only test rooms have, by id.

    Raises:
        SweetHomeError: they are not installed, or damaged.
    """
    table = shipped_pieces() if furniture == CC0 else pieces()
    return frozenset(p.entry.id for role in table.values() for p in role if p.held_out)


def kinds_of(room: Room) -> dict[str, str]:
    """What stands for each goal of a room, by the goal's name."""
    unknown = held_out_models(furniture_of(room.kind))
    # a model that is dyed and stretched is still the same
    models = {owner: one.model.id.partition("~")[0] for one in room.placed for owner in one.owners}
    found: dict[str, set[str]] = defaultdict(set)
    for index, thing in enumerate(room.objects):
        model = models.get(index)
        found[thing.name].add(DRAWN if model is None else UNKNOWN if model in unknown else KNOWN)
    return {name: next(iter(its)) if len(its) == 1 else SEVERAL for name, its in found.items()}


def rows(found: Evaluation) -> list[dict[str, Any]]:
    """Figures of the episodes of each kind, and their goals.

    Raises:
        ValueError: the scenes are of rooms that are made otherwise today.
    """
    kinds = {one.name: kinds_of(room_of(one.name, one.source)) for one in found.bank.scenes}
    goals = [found.bank.objects[goal] for goal in found.episodes.goals]
    of = np.array([kinds[room][goal] for room, goal in zip(found.rooms, goals, strict=True)])
    out = []
    for kind in (UNKNOWN, KNOWN, DRAWN, SEVERAL):
        chosen = np.flatnonzero(of == kind)
        if len(chosen):
            results = [found.results[i] for i in chosen]
            names, counts = np.unique(np.array(goals)[chosen], return_counts=True)
            most = [str(names[i]) for i in np.argsort(-counts, kind="stable")]
            out.append({"kind": kind, **figures(results, found.rooms[chosen]), "goals": most})
    return out


def main(options: ByModelOptions) -> None:
    """Judge and print.

    Raises:
        ValueError: policy, scenes or rooms that cannot be used.
    """
    found = rows(
        evaluate(
            options.policy, options.scenes, options.episodes, options.seed, p_hat=options.p_hat,
            rooms=options.rooms,
        )
    )  # fmt: skip
    print(table(COLUMNS, found))
    if options.json is not None:
        write_json(options.json, {"command": command_line(), "commit": commit(), "rows": found})


if __name__ == "__main__":
    sys.exit(run_options("by_model", ByModelOptions, main))
