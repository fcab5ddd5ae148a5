"""The training loop: rounds of Algorithm 1 with checkpoints, validation and a log line as JSON.

``train`` -> ``algorithm`` -> ``env`` is the whole stack.
"""

from __future__ import annotations

import ctypes
import math
import resource
import signal
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from cfnav_core.agent.config import TrainOptions
from cfnav_core.files.locks import locked
from cfnav_core.learn.algorithm import Learner, NotFiniteError, learning_rate
from cfnav_core.learn.carried import carried, put_back
from cfnav_core.learn.env import ObjectNavEnv
from cfnav_core.learn.run import Run
from cfnav_core.learn.run_files import BEST, CHECKPOINT, LOCK
from cfnav_core.learn.workers import Workers

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

    def still(self) -> AbstractContextManager[None]:
        """Within it the weights of the run do not change."""
        ...

    def carried(self) -> dict[str, Tensor]:
        """What it goes on from besides weights and optimizers; all ranks call it at once."""
        ...


class Synchronous:
    """B episodes side by side; one update a round. Several processes share the episodes."""

    def __init__(self, run: Run) -> None:
        self.run = run
        seed = run.options.run.seed
        # dropout and coins: own ones on every rank
        own = np.random.SeedSequence([seed, run.ranks.rank, run.episodes])
        torch.manual_seed(int(own.generate_state(1)[0]))
        rng = np.random.default_rng([seed, run.episodes])
        generator = torch.Generator().manual_seed(seed * 7_919 + run.episodes)
        env = ObjectNavEnv(run.bank, run.ranks.part(run.hp.batch), rng, run.hp.episode_steps)
        self.learner = Learner(env, run.agent, run.hp, generator, run.ranks)
        if run.carried is not None:
            self._go_on(run.carried)
            run.carried = None

    def _go_on(self, kept: dict[str, Tensor]) -> None:
        run = self.run
        fits = put_back(self.learner, kept)
        if not fits and run.ranks.leads and run.episodes < run.total:
            print(
                f"found no {run.hp.batch} episodes under way in {run.options.out / CHECKPOINT}: it "
                "is of an earlier cfnav, of workers, of another --batch or of other scenes; new "
                "ones begin, and the run ends other than one that never stopped",
                file=sys.stderr,
            )

    def still(self) -> AbstractContextManager[None]:
        """They change in ``round`` alone."""
        return nullcontext()

    def carried(self) -> dict[str, Tensor]:
        """See ``carried.carried``."""
        return carried(self.learner)

    def round(self) -> dict[str, float]:
        """One update."""
        run, lr = self.run, learning_rate(self.run.hp, self.run.episodes)
        try:
            done = self.learner.update(run.stage, run.optimizer, run.predictor_optimizer, lr)
        except NotFiniteError as error:
            raise ValueError(run.not_finite()) from error
        run.episodes += int(done["ended"])
        run.steps += run.hp.batch * run.hp.rollout_length
        return done | {"updates": 1}


def train(options: TrainOptions) -> Path:
    """Run both stages; returns the best checkpoint of stage two by validation CF-SR.

    Raises:
        KeyboardInterrupt: SIGINT or SIGTERM ended the run, after a checkpoint.
        OSError: another process trains in the same folder.
    """
    keep_freed_memory()
    torch.set_num_threads(options.threads)
    torch.set_float32_matmul_precision(options.precision)
    run = Run(options)
    # the one that leads writes; the others end with it
    with locked(options.out / LOCK) if run.ranks.leads else nullcontext():
        return _train(run)


def _train(run: Run) -> Path:
    options = run.options
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
    options, progress, leads = run.options, run.progress, run.ranks.leads
    bar = tqdm(
        total=run.total, initial=run.episodes, unit="episode", mininterval=5, disable=not leads
    )
    saved = since = time.monotonic()
    while True:
        if validated := run.validation_due:
            with execution.still():
                _validate(run, bar)
            if not options.workers:  # who learn on meanwhile
                since = time.monotonic()
        else:
            progress.border = False
        ended = run.episodes >= run.total
        # all ranks save and stop in the same round
        late = leads and time.monotonic() - saved > options.checkpoint_s
        stopped, late = map(bool, run.ranks.total(len(told), late))
        # also after every validation, so that best, log and checkpoint agree
        if validated or late or stopped or ended:
            run.save(CHECKPOINT, execution.carried())
            saved = time.monotonic()
        if progress.border and leads:  # a validation has ended stage one
            run.keep_stage1()
        if stopped or ended:
            break
        episodes, steps = run.episodes, run.steps
        progress.add(execution.round())
        now = time.monotonic()
        progress.add({"steps": run.steps - steps, "seconds": now - since})
        since = now
        bar.update(run.episodes - episodes)
        if episodes < run.hp.stage1_episodes <= run.episodes and not run.judged_stage1:
            progress.border = True
            run.save(CHECKPOINT, execution.carried())
            if leads:
                run.keep_stage1()
    bar.close()


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


def _validate(run: Run, bar: tqdm) -> None:
    """Validate, log, end stage one where that ends it, and keep the best weights so far."""
    in_stage1 = run.progress.border or run.in_stage1
    judges = in_stage1 and run.method.stage1.train_predictor
    figures = _log(run, bar, judges) if run.ranks.leads else {}
    # those that do not lead add nothing
    none = math.nan if run.ranks.leads else 0.0
    cf_sr, auc, kept_auc = run.ranks.total(
        figures.get("validation_cf_sr", 0.0),
        *(figures.get(name, none) for name in ("predictor_auc", "predictor_kept_auc")),
    )
    ends = judges and run.heed(auc, kept_auc)
    # of stage two only: before it, what validation feeds has taught nobody
    counts = run.episodes >= run.total or not (in_stage1 and run.hp.stage2_episodes)
    run.progress.sums.clear()
    run.progress.validated, run.progress.border = run.episodes, ends
    bar.total = run.total
    if counts and cf_sr > run.best:
        run.best = cf_sr
        run.save(BEST)


def _log(run: Run, bar: tqdm, judges: bool) -> dict[str, float]:
    sums = defaultdict(float, run.progress.sums)
    ended, updates = max(1.0, sums["ended"]), max(1.0, sums["updates"])
    tested = run.validate() | (run.judge_predictor() if judges else {})
    figures = {
        "episodes": run.episodes, "steps": run.steps,
        "steps_per_s": sums["steps"] / max(sums["seconds"], 1e-9), "cpu_s": run.cpu_s,
        "memory_mb": own_memory_mb(), "peak_memory_mb": peak_memory_mb(),
        "sr": sums["successes"] / ended, "cf_sr": sums["collision_free"] / ended,
        "collisions_per_episode": sums["collisions"] / ended, "length": sums["steps"] / ended,
        **{k: v / updates for k, v in sums.items() if k.endswith("loss") or k == "entropy"},
        **tested,
    }  # fmt: skip
    run.log.add(figures)
    foresight = f" p_hat AUC {figures['predictor_auc']:.3f}" if "predictor_auc" in figures else ""
    bar.set_postfix_str(
        f"{figures['steps_per_s']:,.0f} steps/s, {figures['memory_mb']:,.0f} MB | "
        f"SR {figures['sr']:.2f} CF-SR {figures['cf_sr']:.2f} | validation "
        f"SR {figures['validation_sr']:.2f} CF-SR {figures['validation_cf_sr']:.2f}" + foresight
    )
    return figures
