"""Algorithm 1 as the paper runs it: asynchronous workers, each with one episode.

Every worker copies the shared weights, acts for t_max steps, and steps the shared optimizer with
its own gradients, without a lock (``cfnav train --workers 32``). Nothing is repeatable: the order
of updates is the machine's. The default execution in ``train`` is.

There is no lock at all: whatever dies, at whatever moment, leaves nothing that others wait for.

Source: Section IV-C and Algorithm 1; optimizer as the lineage's (Adam with AMSGrad, eps 1e-3).
"""

from __future__ import annotations

import gc
import multiprocessing.resource_tracker
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
import torch.multiprocessing as mp
from torch import Tensor, nn

from cfnav_core.agent.agent import new_agent
from cfnav_core.agent.config import TrainOptions
from cfnav_core.agent.find import find_method
from cfnav_core.learn.algorithm import COUNTS, Learner, NotFiniteError, clipped_step
from cfnav_core.learn.env import ObjectNavEnv, SceneBank
from cfnav_core.models.base import Knowledge

if TYPE_CHECKING:
    from cfnav_core.learn.run import Run

EPS = 1e-3
ROUND_S = 0.5
LOOK_S = 0.01
"""Between looks of a worker whether stage two may begin."""
END_S = 60.0
"""A worker that is still busy this long after the end is killed."""
NOT_FINITE = 3
"""Exit code of a worker whose gradients were no numbers."""
COUNTED = (*COUNTS, "steps", "updates")
MOMENTS = ("exp_avg", "exp_avg_sq", "max_exp_avg_sq")


def adam(parameters: list[nn.Parameter], lr: float) -> torch.optim.Adam:
    """The lineage's optimizer."""
    return torch.optim.Adam(parameters, lr, eps=EPS, amsgrad=True, fused=True)


def _parts(vector: Tensor, parameters: list[nn.Parameter]) -> list[Tensor]:
    """A vector as views in the shapes of parameters."""
    pieces = vector.split([p.numel() for p in parameters])
    return [piece.view_as(p) for piece, p in zip(pieces, parameters, strict=True)]


@dataclass
class SharedWeights:
    """Weights and Adam's state in shared memory, one vector each.

    Attributes:
        weights: float32 [n].
        moments: float32 [n] each, in the order of ``MOMENTS``.
        step: float32 [], updates so far.
    """

    weights: Tensor
    moments: list[Tensor]
    step: Tensor

    @classmethod
    def taken_from(cls, optimizer: torch.optim.Adam) -> SharedWeights:
        """Move an optimizer's state and its parameters to shared memory; they become views."""
        parameters = optimizer.param_groups[0]["params"]
        rows = [optimizer.state[p] for p in parameters]
        # a synchronous stage one brings no maximum
        found = [{"max_exp_avg_sq": r["exp_avg_sq"], **r} if r else {} for r in rows]
        weights = nn.utils.parameters_to_vector(parameters).detach().share_memory_()
        moments = [torch.zeros_like(weights).share_memory_() for _ in MOMENTS]
        step = torch.tensor(float(max(row.get("step", 0) for row in found))).share_memory_()
        for parameter, view in zip(parameters, _parts(weights, parameters), strict=True):
            parameter.data = view
        for key, vector in zip(MOMENTS, moments, strict=True):
            for row, old, view in zip(rows, found, _parts(vector, parameters), strict=True):
                if old:
                    view.copy_(old[key])
                row[key] = view
        for row in rows:
            row["step"] = step
        return cls(weights, moments, step)


class Copy:
    """One worker's theta' or phi'.

    Args:
        shared: theta or phi.
        parameters: of the worker's own network; they become views of one vector.
        lr: of Adam.
        max_norm: gradients are clipped to it.
    """

    def __init__(
        self, shared: SharedWeights, parameters: list[nn.Parameter], lr: float, max_norm: float
    ) -> None:
        self.shared, self.max_norm = nn.Parameter(shared.weights), max_norm
        self.weights, self.gradient = (torch.zeros_like(shared.weights) for _ in range(2))
        parts = _parts(self.weights, parameters), _parts(self.gradient, parameters)
        for parameter, weights, gradient in zip(parameters, *parts, strict=True):
            parameter.data, parameter.grad = weights, gradient
        self.optimizer = adam([self.shared], lr)
        moments = dict(zip(MOMENTS, shared.moments, strict=True))
        self.optimizer.state[self.shared] = {"step": shared.step, **moments}
        self.shared.grad = self.gradient

    def fetch(self) -> None:
        """Theta' <- theta, d theta <- 0."""
        self.weights.copy_(self.shared.detach())
        self.gradient.zero_()

    def update(self) -> None:
        """Asynchronous update of theta."""
        clipped_step(self.optimizer, self.max_norm)


@dataclass
class Shared:
    """What all workers see and change.

    Attributes:
        policy, predictor: theta with theta_v, and phi.
        counts: float64 [workers + 1, 6], by ``COUNTED``: each worker adds to its own row; the last
            is what was there before.
        stop: bool [], the run is to end.
        waiting: bool [workers], which have stopped at the end of stage one.
        second: bool [], stage two may begin: what stage one has learnt is kept.
    """

    policy: SharedWeights
    predictor: SharedWeights
    counts: Tensor
    stop: Tensor
    waiting: Tensor
    second: Tensor

    @property
    def episodes(self) -> float:
        """E."""
        return float(self.counts[:, 0].sum())


def work(index: int, options: TrainOptions, knowledge: Knowledge, shared: Shared) -> None:
    """One worker until the run ends, or the process that started it."""
    gc.freeze()  # collections would write to, and so copy, what all workers have imported
    torch.set_num_threads(1)
    torch.set_float32_matmul_precision(options.precision)
    config = options.run
    seed = np.random.SeedSequence([config.seed, index, int(shared.episodes)])
    torch.manual_seed(int(seed.generate_state(1)[0]))
    # what is mapped from disk is in memory once for all workers
    bank = SceneBank.load(
        options.scenes, options.train_rooms, in_memory=False, leave_out=options.leave_out
    )
    agent = new_agent(config, bank.inputs, knowledge)
    method, hp = find_method(config.method), config.hyperparameters
    env = ObjectNavEnv(bank, 1, np.random.default_rng(seed), hp.episode_steps)
    generator = torch.Generator().manual_seed(torch.initial_seed())
    learner = Learner(env, agent, hp, generator, summed=True)
    policy, predictor = (
        Copy(weights, own, hp.lr, hp.max_grad_norm)
        for weights, own in zip((shared.policy, shared.predictor), agent.parameters(), strict=True)
    )
    total = hp.stage1_episodes + hp.stage2_episodes
    while shared.episodes < total and not shared.stop and _parent_lives():
        if shared.episodes >= hp.stage1_episodes and not shared.second:
            shared.waiting[index] = True
            time.sleep(LOOK_S)
            continue
        stage = method.stage2 if shared.second else method.stage1
        policy.fetch()
        predictor.fetch()
        done = learner.gradients(stage)
        try:
            policy.update()
            if stage.train_predictor:
                predictor.update()
        except NotFiniteError:
            sys.exit(NOT_FINITE)  # the process that started it says why
        counts = [done[name] for name in COUNTS]
        shared.counts[index] += torch.tensor([*counts, hp.rollout_length, 1])


def _parent_lives() -> bool:
    parent = mp.parent_process()
    return parent is not None and parent.is_alive()


@contextmanager
def _signals_held() -> Iterator[None]:
    """What is started inside never sees SIGINT or SIGTERM, which a terminal sends to everybody.

    The leader ends its workers by itself; what came meanwhile reaches it afterwards.
    """
    # its start, which the first worker's would bring about, lets signals through again
    multiprocessing.resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class Workers:
    """The workers of a run as a context; ``round`` waits a moment and says what they did.

    Raises:
        ChildProcessError: a worker has ended by itself.
        ValueError: what one saw, or its gradients, were no numbers.
    """

    def __init__(self, run: Run) -> None:
        self.run = run
        policy, predictor = run.agent.parameters()
        run.optimizer = adam(policy, run.hp.lr)
        run.predictor_optimizer = adam(predictor, run.hp.lr)
        run.resume()
        count = run.options.workers
        counts = torch.zeros(count + 1, len(COUNTED), dtype=torch.float64).share_memory_()
        counts[count, 0], counts[count, 4] = run.episodes, run.steps
        stop, waiting, second = (
            torch.zeros(shape, dtype=torch.bool).share_memory_() for shape in ((), count, ())
        )
        weights = [SharedWeights.taken_from(o) for o in (run.optimizer, run.predictor_optimizer)]
        self.shared = Shared(weights[0], weights[1], counts, stop, waiting, second)
        self.before = counts.sum(0)
        self.processes: list[Any] = []

    def __enter__(self) -> Workers:
        """Start them."""
        # forked from one process that has imported everything: 32 of them start at once
        context = mp.get_context("forkserver")
        context.set_forkserver_preload([__name__, "torch._dynamo"])  # which optimizers import
        # E_1 is that of a stage one that was given
        run = replace(self.run.options.run, hyperparameters=self.run.hp)
        options, known = replace(self.run.options, run=run), self.run.knowledge
        try:
            with _signals_held():
                for k in range(options.workers):
                    arguments = (k, options, known, self.shared)
                    process = context.Process(target=work, args=arguments, daemon=True)
                    process.start()
                    self.processes.append(process)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """End them after their present rollout."""
        self.shared.stop.fill_(True)
        deadline = time.monotonic() + END_S
        for process in self.processes:
            process.join(max(0.0, deadline - time.monotonic()))
            if process.is_alive():
                process.kill()
                process.join()

    def round(self) -> dict[str, float]:
        """See ``train.Execution``."""
        stage1 = self.run.hp.stage1_episodes
        self.shared.second.fill_(self.run.episodes >= stage1)
        time.sleep(ROUND_S)
        while not self.shared.second and self.shared.episodes >= stage1 and not self._rest():
            time.sleep(LOOK_S)
        for number, process in enumerate(self.processes):
            if process.exitcode == NOT_FINITE:
                raise ValueError(self.run.not_finite())
            if process.exitcode:
                raise ChildProcessError(
                    f"found worker {number} of {len(self.processes)} ended with "
                    f"{_reason(process.exitcode)}, expected it to run to the end; the same "
                    "command goes on from the last checkpoint"
                )
        now = self.shared.counts.sum(0)
        change, self.before = (now - self.before).tolist(), now
        self.run.episodes, self.run.steps = int(now[0]), int(now[4])
        figures = dict(zip(COUNTED, change, strict=True))
        del figures["steps"]
        return figures

    def _rest(self) -> bool:
        """Whether every worker waits at the end of stage one, or has ended."""
        ended = torch.tensor([process.exitcode is not None for process in self.processes])
        return bool((self.shared.waiting | ended).all())

    @contextmanager
    def still(self) -> Iterator[None]:
        """See ``train.Execution``: the leader has a copy of the weights, workers go on."""
        own = [p for parameters in self.run.agent.parameters() for p in parameters]
        shared = [p.data for p in own]
        for parameter in own:
            parameter.data = parameter.data.clone()
        try:
            yield
        finally:
            for parameter, weights in zip(own, shared, strict=True):
                parameter.data = weights

    def carried(self) -> dict[str, Tensor]:
        """Nothing: each worker begins a new episode."""
        return {}


def _reason(code: int) -> str:
    if code == -signal.SIGKILL:
        return "SIGKILL (out of memory? give fewer --workers)"
    return signal.Signals(-code).name if code < 0 else f"code {code} (see its message above)"
