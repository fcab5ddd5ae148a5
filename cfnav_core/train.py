"""The training loop: rounds of Algorithm 1 with checkpoints, validation and a log line as JSON.

``train`` -> ``algorithm`` -> ``env`` is the whole stack.
"""

from __future__ import annotations

import ctypes
import resource
import signal
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from tqdm import tqdm

from cfnav_core.algorithm import Memory, collect_rollout, losses
from cfnav_core.config import TrainOptions
from cfnav_core.env import ObjectNavEnv
from cfnav_core.models.recurrent import weight_gradients_at_once
from cfnav_core.run import Run
from cfnav_core.run_files import BEST, CHECKPOINT, STAGE1
from cfnav_core.workers import Workers

KEPT = {-1: 2**31 - 1, -3: 32 << 20}
"""M_TRIM_THRESHOLD and M_MMAP_THRESHOLD of GNU's malloc.h, bytes: both the most it takes."""


class Execution(Protocol):
    """A way to carry out Algorithm 1."""

    def round(self) -> dict[str, float]:
        """Learn a little, advance ``Run.episodes`` and ``steps``, and say what happened.

        Returns:
            Sums: ended, successes, collision_free and collisions of episodes, updates, and losses
            summed over updates.
        """
        ...


class Synchronous:
    """B episodes side by side; one update a round. Several processes share the episodes."""

    def __init__(self, run: Run) -> None:
        self.run = run
        seed = run.options.run.seed
        # dropout and coins: own ones on every rank, other ones after a resume
        own = np.random.SeedSequence([seed, run.ranks.rank, run.episodes])
        torch.manual_seed(int(own.generate_state(1)[0]))
        rng = np.random.default_rng([seed, run.episodes])
        self.generator = torch.Generator().manual_seed(seed * 7_919 + run.episodes)
        self.env = ObjectNavEnv(run.bank, run.ranks.part(run.hp.batch), rng, run.hp.episode_steps)
        self.memory = Memory.zeros(self.env, run.agent)

    def round(self) -> dict[str, float]:
        """Roll out, gradients, step."""
        run, hp, ranks = self.run, self.run.hp, self.run.ranks
        stage = run.stage
        self.memory.detach()
        learned = [run.optimizer]
        if stage.train_predictor:
            learned.append(run.predictor_optimizer)
        for optimizer in learned:
            optimizer.zero_grad()
        with weight_gradients_at_once(run.model, run.predictor):
            r = collect_rollout(
                self.env, run.agent, self.memory, stage, hp.rollout_length, self.generator
            )
            moved = int(torch.stack(r.moved_ahead).sum())
            counts = (r.episodes, r.successes, r.collision_free, r.collisions)
            moves, *summed = ranks.total(moved, *counts)
            loss, collision, figures = losses(r, stage, hp, max(moves, 1) / ranks.size)
            # L_c reaches the policy only through an encoder that both share (Wu et al.)
            (loss if collision is None else loss + collision).backward()
        for group in run.optimizer.param_groups:
            group["lr"] = run.learning_rate()
        for optimizer in learned:
            parameters = optimizer.param_groups[0]["params"]
            ranks.average(parameters)
            norm = torch.nn.utils.clip_grad_norm_(parameters, hp.max_grad_norm)
            if not norm.isfinite():
                raise ValueError(run.not_finite())
            optimizer.step()
        run.episodes += int(summed[0])
        run.steps += hp.batch * hp.rollout_length
        names = ("ended", "successes", "collision_free", "collisions")
        return figures | dict(zip(names, summed, strict=True)) | {"updates": 1}


def train(options: TrainOptions) -> Path:
    """Run both stages; returns the best checkpoint of stage two by validation CF-SR.

    Raises:
        KeyboardInterrupt: SIGINT or SIGTERM ended the run, after a checkpoint.
    """
    keep_freed_memory()
    torch.set_num_threads(options.threads)
    torch.set_float32_matmul_precision(options.precision)
    run = Run(options)
    if options.workers:
        workers = Workers(run)
        execution: Execution = workers
        running: AbstractContextManager[object] = workers
    else:
        run.resume()
        execution, running = Synchronous(run), nullcontext()
    with running, _told_to_stop() as told:
        _rounds(run, execution, told)
    run.ranks.leave()
    if run.episodes < run.total:
        raise KeyboardInterrupt(
            f"stopped after {run.episodes} of {run.total} episodes; the same command goes on"
        )
    return options.out / BEST


@contextmanager
def _told_to_stop() -> Iterator[list[int]]:
    """The SIGINT and SIGTERM that came; a run ends between two rounds."""
    told: list[int] = []
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, lambda came, _: told.append(came)) for number in numbers]
    try:
        yield told
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


def _rounds(run: Run, execution: Execution, told: list[int]) -> None:
    options, leads = run.options, run.ranks.leads
    bar = tqdm(
        total=run.total, initial=run.episodes, unit="episode", mininterval=5, disable=not leads
    )
    saved = since = time.monotonic()
    sums: dict[str, float] = {}
    next_validation = _next(run.episodes, options.validation_every)
    # all ranks stop in the same round
    while run.episodes < run.total and not run.ranks.total(len(told))[0]:
        in_stage1 = run.episodes < run.hp.stage1_episodes
        before, first_step = run.episodes, run.steps
        for key, value in execution.round().items():
            sums[key] = sums.get(key, 0.0) + value
        sums["steps"] = sums.get("steps", 0) + run.steps - first_step
        bar.update(run.episodes - before)
        if not leads:
            continue
        if in_stage1 and run.episodes >= run.hp.stage1_episodes:
            run.save(STAGE1)
            run.save(CHECKPOINT)  # others may go on from it at once: a kill must not make another
        if run.episodes >= next_validation or run.episodes >= run.total:
            next_validation = _next(run.episodes, options.validation_every)
            figures = _validate_and_log(run, sums, since, bar)
            # of stage two only: before it, what validation feeds has taught nobody
            if figures["validation_cf_sr"] > run.best and not (
                in_stage1 and run.hp.stage2_episodes
            ):
                run.best = figures["validation_cf_sr"]
                run.save(BEST)
            sums, since = {}, time.monotonic()
        # also after every validation, so that best, log and checkpoint agree
        if not sums or time.monotonic() - saved > options.checkpoint_s:
            run.save(CHECKPOINT)
            saved = time.monotonic()
    if leads:
        run.save(CHECKPOINT)
    bar.close()


def _next(episodes: int, every: int) -> int:
    """The next multiple, so that a resumed run validates where it would have."""
    return (episodes // every + 1) * every


def keep_freed_memory() -> None:
    """Let this process keep what it frees, where the C library is GNU's; elsewhere do nothing.

    A rollout takes as much as the one before it freed. Pages that go back to the system in between
    are cleared and mapped again, which costs a small model a tenth of its time.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        for option, value in KEPT.items():
            mallopt(option, value)


def peak_memory_mb() -> float:
    """Largest resident memory of this process so far, read pages of mapped files included."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def own_memory_mb() -> float:
    """Resident memory of this process that no file backs; nan where the system does not tell."""
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.exists() else []
    found = [int(line.split()[1]) / 1024 for line in lines if line.startswith("RssAnon")]
    return found[0] if found else float("nan")


def _validate_and_log(
    run: Run, sums: dict[str, float], since: float, bar: tqdm
) -> dict[str, float]:
    ended, updates = max(1.0, sums["ended"]), max(1.0, sums["updates"])
    now = time.monotonic()
    tested = run.validate()
    figures = {
        "episodes": run.episodes, "steps": run.steps,
        "steps_per_s": sums["steps"] / (now - since), "cpu_s": run.cpu_s,
        "memory_mb": own_memory_mb(), "peak_memory_mb": peak_memory_mb(),
        "sr": sums["successes"] / ended, "cf_sr": sums["collision_free"] / ended,
        "collisions_per_episode": sums["collisions"] / ended, "length": sums["steps"] / ended,
        **{k: v / updates for k, v in sums.items() if k.endswith("loss") or k == "entropy"},
        **tested,
    }  # fmt: skip
    run.log(figures)
    bar.set_postfix_str(
        f"{figures['steps_per_s']:,.0f} steps/s, {figures['memory_mb']:,.0f} MB | "
        f"SR {figures['sr']:.2f} CF-SR {figures['cf_sr']:.2f} | validation "
        f"SR {figures['validation_sr']:.2f} CF-SR {figures['validation_cf_sr']:.2f}"
    )
    return figures
