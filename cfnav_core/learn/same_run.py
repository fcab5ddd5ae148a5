"""What a run goes on from has to be its own: its checkpoint, or a stage one as its would be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from torch import Tensor

from cfnav_core.agent.find import find_method
from cfnav_core.files.checkpoint import CheckpointError
from cfnav_core.files.provenance import sha256
from cfnav_core.learn.stage_one import NO_RULE
from cfnav_core.scenes.select import scene_names

if TYPE_CHECKING:
    from cfnav_core.learn.run import Run

Head = dict[str, Any]
"""What ``Run.save`` says of a run; older ones say less, and what they leave open is taken as is."""


def check_same(run: Run, tensors: dict[str, Tensor], head: Head) -> None:
    """A run goes on as what it was; only its hyperparameters, such as its length, may change.

    Raises:
        CheckpointError: it was another method, model, seed or size, had other rooms or goals, knew
            something else, began with another stage one, or has left its stage one behind at
            another length.
    """
    options = run.options
    asked = asdict(options.run) | {
        "train_rooms": list(options.train_rooms),
        "validation_rooms": list(options.validation_rooms),
        "validation_episodes": options.validation_episodes,
        "stage1_rule": list(run.rule),
        "leave_out": sorted(options.leave_out),
        "goals": run.goals,
    }
    # what says nothing of a rule had none
    found = {"stage1_rule": list(NO_RULE)} | head | head["config"]
    missing = {"validation_episodes", "leave_out"} - found.keys()
    for key in asked:
        if key not in ("hyperparameters", *missing) and found.get(key) != asked[key]:
            raise CheckpointError(
                f"found a run with {key} {found.get(key)!r} in {options.out}, but "
                f"{asked[key]!r} is asked for; choose another --out or delete it"
            )
    if not _knows_the_same(run, tensors):
        raise CheckpointError(
            f"found a run in {options.out} that knew something else of the objects than "
            f"{options.knowledge}; give its own --knowledge, or choose another --out"
        )
    began = head.get("began")
    if options.stage1 and began is not None and began != _sum(options.stage1):
        raise CheckpointError(
            f"found a run in {options.out} that did not begin with {options.stage1}; leave out "
            "--stage1, or choose another --out"
        )
    before = head["config"]["hyperparameters"]["stage1_episodes"]
    now = options.run.hyperparameters.stage1_episodes
    by_rule = run.rule != NO_RULE or head.get("stage1", {}).get("ended") is not None
    if before != now and head["episodes"] >= min(before, now) and not by_rule:
        raise CheckpointError(
            f"found a run in {options.out} after {head['episodes']} episodes with a stage one of "
            f"{before}, but {now} are asked for; that is too late: choose another --out"
        )


def check_stage1(run: Run, source: Path, tensors: dict[str, Tensor], head: Head) -> None:
    """Stage one may come from a run whose stage one is this run's.

    It may also have trained a predictor that this run does not need, so that methods are
    compared from the same weights.

    Raises:
        CheckpointError: it is another stage one, or none.
    """
    options = run.options
    asked, found = asdict(options.run), head["config"]
    there = find_method(found["method"])
    same_rule = there.shared_encoder == run.method.shared_encoder and run.method.stage1 in (
        there.stage1, replace(there.stage1, train_predictor=False)
    )  # fmt: skip
    asked |= {"train_rooms": _names(run, options.train_rooms), "goals": run.goals}
    found = found | {"train_rooms": _names(run, head["train_rooms"]), "goals": head["goals"]}
    if "leave_out" in head:
        asked["leave_out"], found["leave_out"] = sorted(options.leave_out), head["leave_out"]
    different = [
        key for key in asked
        if key not in ("hyperparameters", "method") and asked[key] != found.get(key)
    ] + ([] if same_rule else ["method"])  # fmt: skip
    if different:
        raise CheckpointError(
            f"found {source} of a run with {different[0]} {found.get(different[0])!r}, whose "
            f"stage one is not that of {asked[different[0]]!r}; leave out --stage1"
        )
    if not _knows_the_same(run, tensors):
        raise CheckpointError(
            f"found {source} of a run that knew something else of the objects than "
            f"{options.knowledge}; give its own --knowledge, or leave out --stage1"
        )
    length, ended = found["hyperparameters"]["stage1_episodes"], head.get("stage1", {}).get("ended")
    by_rule = tuple(head.get("stage1_rule", NO_RULE)) != NO_RULE
    if by_rule and ended is None:
        raise CheckpointError(
            f"found {source} after {head['episodes']} episodes of a stage one that is to go on "
            "until its predictor no longer gains; let that run go on first"
        )
    if ended is None and head["episodes"] < length:
        raise CheckpointError(
            f"found {source} after {head['episodes']} episodes, expected all {length} of stage "
            "one; let that run go on first"
        )
    # where stage one has just ended nothing was validated in stage two
    if not head.get("progress", {"border": head["best"] < 0})["border"]:
        raise CheckpointError(
            f"found {source} after {head['episodes']} episodes, which is no longer stage one; give "
            "stage1.safetensors of that run"
        )
    if ended is None and length != run.hp.stage1_episodes:
        raise CheckpointError(
            f"found {source} of a stage one of {length} episodes, expected "
            f"{run.hp.stage1_episodes}; give --stage1-episodes {length}"
        )


def _knows_the_same(run: Run, tensors: dict[str, Tensor]) -> bool:
    known = {f"knowledge.{k}": v for k, v in run.knowledge.arrays().items()}
    stored = {k: v.numpy() for k, v in tensors.items() if k.startswith("knowledge.")}
    same = known.keys() == stored.keys()
    return same and all(np.array_equal(known[k], stored[k]) for k in known)


def _names(run: Run, rooms: Sequence[str]) -> list[str]:
    return sorted(scene_names(run.options.scenes, rooms))


def _sum(stage1: Path) -> str:
    try:
        return sha256(stage1)
    except OSError as error:
        raise CheckpointError(
            f"found no readable stage one at {stage1} ({error}); leave out --stage1, or give the "
            "one that the run began with"
        ) from error
