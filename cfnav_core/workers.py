"""Algorithm 1 as the paper runs it: asynchronous workers, each with one episode.

Every worker copies the shared weights, acts for t_max steps, and steps the shared optimizer with
its own gradients, without a lock (``cfnav train --workers 32``). Nothing is repeatable: the order
of updates is the machine's. The default execution in ``train`` is.

Source: Section IV-C and Algorithm 1; optimizer as the lineage's (Adam with AMSGrad, eps 1e-3).
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
import torch.multiprocessing as mp
from torch import nn

from cfnav_core.agent import Agent, new_agent
from cfnav_core.algorithm import Memory, collect_rollout, losses
from cfnav_core.config import TrainOptions
from cfnav_core.env import ObjectNavEnv, SceneBank
from cfnav_core.methods import METHODS
from cfnav_core.models import Knowledge

if TYPE_CHECKING:
    from cfnav_core.run import Run

EPS = 1e-3
ROUND_S = 0.5
COUNTS = ("ended", "successes", "collision_free", "collisions", "steps", "updates")


class SharedAdam(torch.optim.Adam):
    """Adam whose state lies in shared memory from the start."""

    def __init__(self, parameters: list[nn.Parameter], lr: float) -> None:
        super().__init__(parameters, lr, eps=EPS, amsgrad=True)
        for parameter in parameters:
            self.state[parameter] = {
                "step": torch.zeros(()).share_memory_(),
                **{
                    key: torch.zeros_like(parameter).share_memory_()
                    for key in ("exp_avg", "exp_avg_sq", "max_exp_avg_sq")
                },
            }


@dataclass
class Shared:
    """What all workers see and change.

    Attributes:
        agent: weights in shared memory.
        optimizer, predictor_optimizer: over them, without parameters held twice.
        counts: float64 in shared memory, by ``COUNTS``.
        stop: set when the run is to end.
    """

    agent: Agent
    optimizer: SharedAdam
    predictor_optimizer: SharedAdam
    counts: torch.Tensor
    lock: Any
    stop: Any

    @classmethod
    def of(cls, agent: Agent, lr: float) -> Shared:
        """Move an agent to shared memory."""
        agent.model.share_memory()
        agent.predictor.share_memory()
        policy = {id(p) for p in agent.model.parameters()}
        own = [p for p in agent.predictor.parameters() if id(p) not in policy]
        context = mp.get_context("spawn")
        counts = torch.zeros(len(COUNTS), dtype=torch.float64).share_memory_()
        return cls(
            agent, SharedAdam(list(agent.model.parameters()), lr), SharedAdam(own, lr), counts,
            context.Lock(), context.Event(),
        )  # fmt: skip

    def add(self, *numbers: float) -> None:
        """Count; all at once."""
        with self.lock:
            self.counts += torch.tensor(numbers, dtype=torch.float64)


def work(index: int, options: TrainOptions, knowledge: Knowledge, shared: Shared) -> None:
    """One worker until the run ends."""
    torch.set_num_threads(1)
    config = options.run
    seed = np.random.SeedSequence([config.seed, index, int(shared.counts[0])])
    torch.manual_seed(int(seed.generate_state(1)[0]))
    bank = SceneBank.load(options.scenes, options.train_rooms)
    agent = new_agent(config, bank.inputs, knowledge)
    env = ObjectNavEnv(bank, 1, np.random.default_rng(seed))
    memory = Memory.zeros(env, agent)
    generator = torch.Generator().manual_seed(torch.initial_seed())
    method, hp = METHODS[config.method], config.hyperparameters
    while not shared.stop.is_set():
        stage = method.stage1 if shared.counts[0] < hp.stage1_episodes else method.stage2
        copy_weights(shared.agent, agent)
        memory.detach()
        rollout = collect_rollout(env, agent, memory, stage, hp.rollout_length, generator)
        # sums over the rollout, as printed
        loss, collision, _ = losses(rollout, stage, hp, moves=1.0)
        apply_gradients(agent, shared, loss * hp.rollout_length, collision, hp.max_grad_norm)
        shared.add(
            rollout.episodes, rollout.successes, rollout.collision_free, rollout.collisions,
            hp.rollout_length, 1,
        )  # fmt: skip


def copy_weights(source: Agent, target: Agent) -> None:
    """Theta' <- theta, phi' <- phi."""
    with torch.no_grad():
        for name in ("model", "predictor"):
            pairs = zip(
                getattr(source, name).parameters(), getattr(target, name).parameters(), strict=True
            )
            for ours, theirs in pairs:
                theirs.copy_(ours)


def apply_gradients(
    agent: Agent, shared: Shared, loss: torch.Tensor, collision: torch.Tensor | None,
    max_norm: float,
) -> None:  # fmt: skip
    """Asynchronous update of theta, and of phi where it learns."""
    for module in (agent.model, agent.predictor):
        module.zero_grad(set_to_none=True)
    (loss if collision is None else loss + collision).backward()
    learned: list[tuple[nn.Module, nn.Module, SharedAdam]] = [
        (agent.model, shared.agent.model, shared.optimizer)
    ]
    if collision is not None:
        learned.append((agent.predictor, shared.agent.predictor, shared.predictor_optimizer))
    for own, common, optimizer in learned:
        nn.utils.clip_grad_norm_(own.parameters(), max_norm)
        for parameter, target in zip(own.parameters(), common.parameters(), strict=True):
            target.grad = parameter.grad
        optimizer.step()


class Workers:
    """The workers of a run as a context; ``round`` waits a moment and says what they did.

    Raises:
        RuntimeError: a worker has ended by itself.
    """

    def __init__(self, run: Run) -> None:
        self.run, self.shared = run, Shared.of(run.agent, run.hp.lr)
        run.optimizer = self.shared.optimizer
        run.predictor_optimizer = self.shared.predictor_optimizer
        run.resume()
        for optimizer in (run.optimizer, run.predictor_optimizer):
            for row in optimizer.state.values():
                for value in row.values():
                    value.share_memory_()  # what a checkpoint brought
        self.shared.counts[0], self.shared.counts[4] = run.episodes, run.steps
        self.before = self.shared.counts.clone()
        self.processes: list[Any] = []

    def __enter__(self) -> Workers:
        """Start them."""
        context = mp.get_context("spawn")
        options, known = self.run.options, self.run.knowledge
        for k in range(options.workers):
            process = context.Process(target=work, args=(k, options, known, self.shared))
            process.daemon = True
            process.start()
            self.processes.append(process)
        return self

    def __exit__(self, *_: object) -> None:
        """End them after their present rollout."""
        self.shared.stop.set()
        for process in self.processes:
            process.join()

    def round(self) -> dict[str, float]:
        """See ``train.Execution``."""
        time.sleep(ROUND_S)
        for number, process in enumerate(self.processes):
            if process.exitcode is not None:
                raise RuntimeError(
                    f"worker {number} ended with code {process.exitcode}; see its message above"
                )
        now = self.shared.counts.clone()
        change, self.before = (now - self.before).tolist(), now
        self.run.episodes, self.run.steps = int(now[0]), int(now[4])
        figures = dict(zip(COUNTS, change, strict=True))
        del figures["steps"]
        return figures
