"""Algorithm 1 in the printed order, for B synchronous episodes instead of asynchronous workers.

Departures, each also a row in docs/departures.md: episodes have a step limit and a cut one is
bootstrapped with V (the paper's have none); advantages are lambda-returns; L_c is a mean.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import torch
import torch.nn.functional as F
from torch import Tensor

from cfnav_core.agent.agent import Agent
from cfnav_core.agent.collision_predictor import collision_loss
from cfnav_core.agent.config import Hyperparameters
from cfnav_core.agent.methods import Stage
from cfnav_core.agent.reward import RewardMemory, path_shaping, total_reward
from cfnav_core.learn.env import EpisodeSlice, ObjectNavEnv, StepResult
from cfnav_core.learn.ranks import Ranks
from cfnav_core.models.base import ModelInput, State
from cfnav_core.models.parts.recurrent import weight_gradients_at_once
from cfnav_core.task.actions import NUM_ACTIONS, Action
from cfnav_core.task.p_hat import Known, make_p_hat


@dataclass
class Memory:
    """What B episodes carry from step to step, all float32.

    Attributes:
        policy: see ``NavModel.state_shapes``. predictor: [B, 4, H'].
        previous_action: [B, 6] one-hot, zeros at the start of an episode.
        reward: see ``RewardMemory``.
    """

    policy: State
    predictor: Tensor
    previous_action: Tensor
    reward: RewardMemory

    @classmethod
    def zeros(cls, env: ObjectNavEnv, agent: Agent) -> Memory:
        """At the start of B episodes."""
        return cls(
            agent.model.zero_state(env.batch),
            torch.zeros(env.batch, *agent.predictor.state_shape, device=env.device),
            torch.zeros(env.batch, NUM_ACTIONS, device=env.device),
            RewardMemory.start(env.batch, len(env.bank.objects), env.device),
        )

    def detach(self) -> None:
        """Cut the gradient at a rollout's border."""
        self.policy = {k: v.detach() for k, v in self.policy.items()}
        self.predictor = self.predictor.detach()

    def forget(self, ended: Tensor) -> None:
        """Zero the rows of episodes that ended (bool [B])."""
        self.policy = {k: _kept(v, ended) for k, v in self.policy.items()}
        self.predictor = _kept(self.predictor, ended)
        self.previous_action = _kept(self.previous_action, ended)
        self.reward = self.reward.forget(ended)


def _kept(rows: Tensor, ended: Tensor) -> Tensor:
    """The rows, zero where an episode ended; never 0 * inf."""
    return rows.masked_fill(ended.view(-1, *[1] * (rows.dim() - 1)), 0.0)


COUNTS = ("ended", "successes", "collision_free", "collisions")
"""What is counted of the episodes that end in a rollout; collisions are those of all of them."""


@dataclass
class Rollout:
    """T steps of B episodes.

    Attributes:
        log_probability, entropy, value, reward: float32 [B] of each step.
        next_value_if_cut: float32 [B] of each step, V of the state in which an episode was cut.
        ended, collided, moved_ahead: bool [B] of each step.
        collision_logit: float32, of all steps in order, one by one or at once; none where nobody
            predicts.
        happened: int64 [4] of each step, see ``COUNTS``.
        bootstrap: float32 [B], V of the states after the last step.
    """

    log_probability: list[Tensor] = field(default_factory=list)
    entropy: list[Tensor] = field(default_factory=list)
    value: list[Tensor] = field(default_factory=list)
    reward: list[Tensor] = field(default_factory=list)
    next_value_if_cut: list[Tensor] = field(default_factory=list)
    ended: list[Tensor] = field(default_factory=list)
    collided: list[Tensor] = field(default_factory=list)
    moved_ahead: list[Tensor] = field(default_factory=list)
    collision_logit: list[Tensor] = field(default_factory=list)
    happened: list[Tensor] = field(default_factory=list)
    bootstrap: Tensor | None = None

    def add(
        self, log_pi: Tensor, action: Tensor, value: Tensor, reward: Tensor, outcome: StepResult,
        collisions: Tensor,
    ) -> None:  # fmt: skip
        """Take a step: log pi [B, 6], a_t, V [B, 1], r_t, what it did, collisions so far."""
        pi = log_pi.exp()
        self.log_probability.append(log_pi.gather(1, action[:, None])[:, 0])
        self.entropy.append(-(pi * log_pi).sum(1))
        self.value.append(value[:, 0])
        self.reward.append(reward)
        self.ended.append(outcome.ended)
        self.collided.append(outcome.collided)
        self.moved_ahead.append(action == Action.MoveAhead)
        clean = outcome.success & (collisions == 0)
        episodes = torch.stack([outcome.ended, outcome.success, clean]).sum(1)
        self.happened.append(torch.cat([episodes, (collisions * outcome.ended).sum()[None]]))

    @property
    def counts(self) -> list[int]:
        """What happened, in the order of ``COUNTS``."""
        found: list[int] = torch.stack(self.happened).sum(0).tolist()
        return found


class Predictions:
    """The predictor's part in a rollout, and so what the policy is given for p_hat.

    A predictor that the policy reads predicts at each step. One that only learns predicts after
    the rollout, all steps at once, which is faster.
    """

    def __init__(self, agent: Agent, memory: Memory, stage: Stage, rollout: Rollout) -> None:
        self._agent, self._memory, self._stage, self._rollout = agent, memory, stage, rollout
        self._before = memory.predictor
        self._features: list[Tensor] = []
        self._previous_action: list[Tensor] = []

    def p_hat(self, env: ObjectNavEnv, features: Tensor) -> Tensor:
        """What the policy is given where the episodes are, float32 [B, 1]."""
        if self._stage.predicts_for_nobody:
            self._features.append(features)
            self._previous_action.append(self._memory.previous_action)
        known = Known(
            zero=torch.zeros(env.batch, device=env.device),
            own=partial(self._predict, features),
            truth=env.blocked.float() if self._stage.p_hat == "true" else None,
        )
        given: Tensor = make_p_hat(self._stage.p_hat, known)
        return given[:, None]

    def _predict(self, features: Tensor) -> Tensor:
        memory = self._memory
        with torch.set_grad_enabled(self._stage.train_predictor):
            logit, memory.predictor = self._agent.predictor(
                features, memory.previous_action, memory.predictor
            )
        self._rollout.collision_logit.append(logit[:, 0])
        return torch.sigmoid(logit[:, 0]).detach()

    def finish(self) -> None:
        """The rollout is over: predict what nobody read."""
        if self._features:
            logits, self._memory.predictor = self._agent.predictor.sequence(
                torch.cat(self._features), torch.cat(self._previous_action), self._before,
                torch.stack(self._rollout.ended),
            )  # fmt: skip
            self._rollout.collision_logit.append(logits)


@dataclass
class Reached:
    """States whose V is asked for: those where an episode was cut short, and those after a rollout.

    All are judged at once after the rollout, as its weights stay the same. No memory advances. The
    last p_hat stands in for the next one, so that the predictor advances once per real step.

    Attributes:
        where: bool [B] of each step, and of the end. seen, memory: their rows.
    """

    where: list[Tensor] = field(default_factory=list)
    seen: list[ModelInput] = field(default_factory=list)
    memory: list[State] = field(default_factory=list)

    @torch.no_grad()
    def add(self, where: Tensor, env: ObjectNavEnv, memory: Memory, p_hat: Tensor) -> None:
        """Ask for V of the present states, bool [B]."""
        self.where.append(where)
        if not where.any():
            return
        features, detections = env.bank.observe(env.state[where])
        self.seen.append(ModelInput(
            features, detections, env.goal_one_hot[where], env.room_one_hot[where],
            memory.previous_action[where], p_hat[where],
        ))  # fmt: skip
        self.memory.append({k: v[where] for k, v in memory.policy.items()})

    @torch.no_grad()
    def values(self, agent: Agent) -> Tensor:
        """V where asked for, 0 elsewhere: float32 [T + 1, B]."""
        seen = ModelInput(*map(torch.cat, zip(*(vars(s).values() for s in self.seen), strict=True)))
        memory = {k: torch.cat([m[k] for m in self.memory]) for k in self.memory[0]}
        where = torch.stack(self.where)
        out = torch.zeros(where.shape, device=where.device)
        out[where] = agent.model(seen, memory)[1][:, 0]
        return out


def collect_rollout(
    env: ObjectNavEnv, agent: Agent, memory: Memory, stage: Stage, length: int,
    generator: torch.Generator,
) -> Rollout:  # fmt: skip
    """The inner loop of Algorithm 1: act for ``length`` steps in every episode."""
    r, reached = Rollout(), Reached()
    predictions = Predictions(agent, memory, stage, r)
    for _ in range(length):
        features, detections = env.observe()  # Alg. 1: acquire image I_t
        # Alg. 1: predict collision p_hat_t; O_t <- (I_t, g, p_hat_t), or (I_t, g, 0)
        p_hat = predictions.p_hat(env, features)
        seen = ModelInput(
            features, detections, env.goal_one_hot, env.room_one_hot, memory.previous_action, p_hat
        )
        logits, value, memory.policy = agent.model(seen, memory.policy)
        log_pi = torch.log_softmax(logits, 1)
        action = _sampled(log_pi.detach().exp(), env.part, generator)  # Alg. 1: execute a_t
        before = env.state
        outcome = env.step(action)  # Alg. 1: observe p_t and r_t (Eq. 4)
        reward = _reward(env, agent, memory, stage, before, action, outcome)
        memory.previous_action = F.one_hot(action, NUM_ACTIONS).float()
        r.add(log_pi, action, value, reward, outcome, env.collisions)
        if stage.p_hat == "true":
            p_hat = env.blocked[:, None].float()  # for V of the state that was reached
        reached.add(outcome.truncated, env, memory, p_hat)
        env.restart(outcome.ended)
        memory.forget(outcome.ended)
    predictions.finish()
    reached.add(torch.ones_like(r.ended[-1]), env, memory, p_hat)
    *r.next_value_if_cut, r.bootstrap = reached.values(agent)
    return r


def _sampled(pi: Tensor, part: EpisodeSlice, generator: torch.Generator) -> Tensor:
    """Actions int64 [B] drawn from pi [B, 6]."""
    u = part.rows(torch.rand(part.total, 1, generator=generator, device="cpu"))
    below = pi.cumsum(1) < u.to(pi.device)
    return below.sum(1).clamp(max=NUM_ACTIONS - 1)


def _reward(
    env: ObjectNavEnv, agent: Agent, memory: Memory, stage: Stage, before: Tensor, action: Tensor,
    outcome: StepResult,
) -> Tensor:  # fmt: skip
    """r_t of a step that began in the states ``before``, float32 [B]."""
    shaping = stage.distance_shaping
    facts = env.facts(before, action, outcome.success, paths=shaping != 0)
    r_o, memory.reward = agent.reward(facts, memory.reward, agent.tables)
    reward = total_reward(r_o, outcome.collided, stage.collision_penalty)
    return reward + shaping * path_shaping(facts) if shaping else reward


def compute_returns(r: Rollout, gamma: float, gae_lambda: float) -> tuple[Tensor, Tensor]:
    """Returns R and advantages delta, float32 [T, B] each, without gradient.

    Alg. 1: R <- 0 if a_t = Done else V; R <- r_i + gamma R; delta <- R - V(O_i). With
    ``gae_lambda`` below 1 the advantages are the usual exponential average of such deltas.
    """
    assert r.bootstrap is not None
    values = torch.stack(r.value).detach()
    advantages = torch.empty_like(values)
    following, advantage = r.bootstrap, torch.zeros_like(r.bootstrap)
    for t in reversed(range(len(r.reward))):
        going = (~r.ended[t]).float()
        # an ended step leads to 0 (Done) or to V of the state it was cut in
        next_value = going * following + r.next_value_if_cut[t]
        delta = r.reward[t] + gamma * next_value - values[t]
        advantage = delta + gamma * gae_lambda * going * advantage
        advantages[t] = advantage
        following = values[t]
    return advantages + values, advantages


def losses(
    r: Rollout, stage: Stage, hp: Hyperparameters, moves: float | None = None
) -> tuple[Tensor, Tensor | None, dict[str, float]]:
    """The policy's loss, the predictor's loss (None when frozen or absent), and figures to log.

    ``moves`` is the number of MoveAheads to average L_c over, when others share the update.
    """
    returns, advantages = compute_returns(r, hp.gamma, hp.gae_lambda)
    policy = -(torch.stack(r.log_probability) * advantages).mean()
    value = F.mse_loss(torch.stack(r.value), returns)
    entropy = torch.stack(r.entropy).mean()
    loss = policy + hp.value_weight * value - hp.entropy_weight * entropy
    figures = {"policy_loss": policy.item(), "value_loss": value.item(), "entropy": entropy.item()}
    collision = None
    if stage.train_predictor:  # Alg. 1: if E < E_1 and a_i = MoveAhead
        logit, collided = torch.cat(r.collision_logit), torch.cat(r.collided)
        collision = collision_loss(logit, collided, torch.cat(r.moved_ahead), moves)
        figures["collision_loss"] = collision.item()
    return loss, collision, figures


def learning_rate(hp: Hyperparameters, episodes: int) -> float:
    """Of theta after so many episodes: constant in stage one, falling to a tenth in stage two."""
    progress = (episodes - hp.stage1_episodes) / max(1, hp.stage2_episodes)
    return hp.lr * (1 - 0.9 * min(max(progress, 0.0), 1.0))


class NotFiniteError(ValueError):
    """Gradients are no numbers; nothing was learned of them."""


def clipped_step(optimizer: torch.optim.Optimizer, max_norm: float) -> None:
    """Clip the gradients to a global norm and take a step.

    Raises:
        NotFiniteError: they are no numbers.
    """
    norm = torch.nn.utils.clip_grad_norm_(optimizer.param_groups[0]["params"], max_norm)
    if not norm.isfinite():
        raise NotFiniteError(
            "found a gradient that is no number; look at the scenes with cfnav data check, or "
            "give a smaller --lr"
        )
    optimizer.step()


@dataclass
class Learner:
    """An agent that learns in its environment.

    Attributes:
        env, agent: who learns, and where. hp: the numbers. generator: draws the actions.
        ranks: with whom every update is shared.
        summed: losses are sums over a rollout, as printed, and not means.
        memory: of the episodes under way.
    """

    env: ObjectNavEnv
    agent: Agent
    hp: Hyperparameters
    generator: torch.Generator
    ranks: Ranks = field(default_factory=Ranks)
    summed: bool = False
    memory: Memory = field(init=False)

    def __post_init__(self) -> None:
        self.memory = Memory.zeros(self.env, self.agent)

    def gradients(self, stage: Stage) -> dict[str, float]:
        """Roll out, and add the gradients of theta, and of phi where it learns.

        Returns:
            ``COUNTS`` of all ranks, and one's own losses.
        """
        hp, size = self.hp, self.ranks.size
        self.memory.detach()
        with weight_gradients_at_once(self.agent.model, self.agent.predictor):
            r = collect_rollout(
                self.env, self.agent, self.memory, stage, hp.rollout_length, self.generator
            )
            moved, *counts = self.ranks.total(int(torch.stack(r.moved_ahead).sum()), *r.counts)
            moves = 1.0 if self.summed else max(moved, 1) / size
            loss, collision, figures = losses(r, stage, hp, moves)
            if self.summed:
                loss = loss * hp.rollout_length
            # L_c reaches the policy only through an encoder that both share (Wu et al.)
            (loss if collision is None else loss + collision).backward()
        return figures | dict(zip(COUNTS, counts, strict=True))

    def update(
        self, stage: Stage, policy: torch.optim.Optimizer, predictor: torch.optim.Optimizer,
        lr: float,
    ) -> dict[str, float]:  # fmt: skip
        """One update of theta, with a learning rate, and of phi where it learns.

        Returns:
            As ``gradients``.

        Raises:
            NotFiniteError: gradients are no numbers.
        """
        learned = [policy, predictor] if stage.train_predictor else [policy]
        for optimizer in learned:
            optimizer.zero_grad()
        figures = self.gradients(stage)
        for group in policy.param_groups:
            group["lr"] = lr
        for optimizer in learned:
            self.ranks.average(optimizer.param_groups[0]["params"])
            clipped_step(optimizer, self.hp.max_grad_norm)
        return figures
