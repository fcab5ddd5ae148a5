"""Algorithm 1 in the printed order, for B synchronous episodes instead of asynchronous workers.

Departures, each also a row in ARCHITECTURE.md: episodes have a step limit and a cut one is
bootstrapped with V (the paper's have none); advantages are lambda-returns; L_c is a mean.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import torch
import torch.nn.functional as F
from torch import Tensor

from cfnav_core.actions import NUM_ACTIONS, Action
from cfnav_core.agent import Agent
from cfnav_core.collision_predictor import collision_loss
from cfnav_core.config import Hyperparameters
from cfnav_core.env import ObjectNavEnv, Part
from cfnav_core.methods import Stage
from cfnav_core.models import Seen, State
from cfnav_core.reward import RewardMemory, path_shaping, total_reward


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


@dataclass
class Rollout:
    """T steps of B episodes; lists of [B] tensors, ``bootstrap`` is V of the state after them."""

    log_probability: list[Tensor]
    entropy: list[Tensor]
    value: list[Tensor]
    reward: list[Tensor]
    next_value_if_cut: list[Tensor]
    ended: list[Tensor]
    collision_logit: list[Tensor]
    collided: list[Tensor]
    moved_ahead: list[Tensor]
    bootstrap: Tensor
    episodes: int
    successes: int
    collision_free: int
    collisions: int


@dataclass
class Unfed:
    """What the predictor saw in a rollout whose policy reads no p_hat: predicted after it, at once.

    Attributes:
        state: [B, 4, H'], before the first step.
        features, previous_action: of each step, see ``Seen``.
    """

    state: Tensor
    features: list[Tensor]
    previous_action: list[Tensor]

    def predict(self, agent: Agent, ended: Tensor) -> tuple[Tensor, Tensor]:
        """Logits [T * B] and the next state, see ``CollisionPredictor.sequence``."""
        features, actions = torch.cat(self.features), torch.cat(self.previous_action)
        return agent.predictor.sequence(features, actions, self.state, ended)


@dataclass
class Reached:
    """States whose V is asked for: those where an episode was cut short, and those after a rollout.

    All are judged at once after the rollout, as its weights stay the same. No memory advances. The
    last p_hat stands in for the next one, so that the predictor advances once per real step.

    Attributes:
        where: bool [B] of each step, and of the end. seen, memory: their rows.
    """

    where: list[Tensor] = field(default_factory=list)
    seen: list[Seen] = field(default_factory=list)
    memory: list[State] = field(default_factory=list)

    @torch.no_grad()
    def add(self, where: Tensor, env: ObjectNavEnv, memory: Memory, p_hat: Tensor) -> None:
        """Ask for V of the present states, bool [B]."""
        self.where.append(where)
        if not where.any():
            return
        features, detections = env.bank.observe(env.state[where])
        self.seen.append(Seen(
            features, detections, env.goal_one_hot[where], env.room_one_hot[where],
            memory.previous_action[where], p_hat[where],
        ))  # fmt: skip
        self.memory.append({k: v[where] for k, v in memory.policy.items()})

    @torch.no_grad()
    def values(self, agent: Agent) -> Tensor:
        """V where asked for, 0 elsewhere: float32 [T + 1, B]."""
        seen = Seen(*map(torch.cat, zip(*(vars(s).values() for s in self.seen), strict=True)))
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
    nothing = torch.zeros(env.batch, device=env.device)
    r = Rollout([], [], [], [], [], [], [], [], [], nothing, 0, 0, 0, 0)
    counts = torch.zeros(4, dtype=torch.int64, device=env.device)
    unfed = Unfed(memory.predictor, [], []) if stage.predicts_for_nobody else None
    reached = Reached()
    for _ in range(length):
        features, detections = env.observe()  # Alg. 1: acquire image I_t
        p_hat = nothing[:, None]
        if unfed is not None:
            unfed.features.append(features)
            unfed.previous_action.append(memory.previous_action)
        elif stage.train_predictor or stage.feed_prediction:  # Alg. 1: predict collision p_hat_t
            with torch.set_grad_enabled(stage.train_predictor):
                logit, memory.predictor = agent.predictor(
                    features, memory.previous_action, memory.predictor
                )
            r.collision_logit.append(logit[:, 0])
            if stage.feed_prediction:  # Alg. 1: O_t <- (I_t, g, p_hat_t), else (I_t, g, 0)
                p_hat = torch.sigmoid(logit).detach()
        if stage.feed_truth:
            p_hat = env.blocked[:, None].float()
        seen = Seen(
            features, detections, env.goal_one_hot, env.room_one_hot, memory.previous_action, p_hat
        )
        logits, value, memory.policy = agent.model(seen, memory.policy)
        log_pi = torch.log_softmax(logits, 1)
        pi = log_pi.exp()
        action = _sampled(pi.detach(), env.part, generator)  # Alg. 1: execute a_t
        before = env.state
        outcome = env.step(action[:, 0])  # Alg. 1: observe p_t and r_t (Eq. 4)
        if stage.feed_truth:
            p_hat = env.blocked[:, None].float()  # for V of the state that was reached
        shaping = stage.distance_shaping
        facts = env.facts(before, action[:, 0], outcome.success, paths=shaping != 0)
        r_o, memory.reward = agent.reward(facts, memory.reward, agent.tables)
        reward = total_reward(r_o, outcome.collided, stage.collision_penalty)
        if shaping:
            reward = reward + shaping * path_shaping(facts)
        memory.previous_action = F.one_hot(action[:, 0], NUM_ACTIONS).float()
        ended = outcome.terminated | outcome.truncated
        r.log_probability.append(log_pi.gather(1, action)[:, 0])
        r.entropy.append(-(pi * log_pi).sum(1))
        r.value.append(value[:, 0])
        r.reward.append(reward)
        r.ended.append(ended)
        reached.add(outcome.truncated, env, memory, p_hat)
        r.collided.append(outcome.collided)
        r.moved_ahead.append(action[:, 0] == Action.MoveAhead)
        clean = outcome.success & (env.collisions == 0)
        happened = torch.stack([ended, outcome.success, clean]).sum(1)
        counts += torch.cat([happened, (env.collisions * ended).sum()[None]])
        env.restart(ended)
        memory.forget(ended)
    if unfed is not None:
        logit, memory.predictor = unfed.predict(agent, torch.stack(r.ended))
        r.collision_logit.append(logit)
    reached.add(torch.ones_like(ended), env, memory, p_hat)
    *r.next_value_if_cut, r.bootstrap = reached.values(agent)
    r.episodes, r.successes, r.collision_free, r.collisions = counts.tolist()
    return r


def _sampled(pi: Tensor, part: Part, generator: torch.Generator) -> Tensor:
    """Actions int64 [B, 1] drawn from pi [B, 6]."""
    u = part.rows(torch.rand(part.of, 1, generator=generator, device="cpu"))
    below = pi.cumsum(1) < u.to(pi.device)
    return below.sum(1, keepdim=True).clamp(max=NUM_ACTIONS - 1)


def compute_returns(r: Rollout, gamma: float, gae_lambda: float) -> tuple[Tensor, Tensor]:
    """Returns R and advantages delta, float32 [T, B] each, without gradient.

    Alg. 1: R <- 0 if a_t = Done else V; R <- r_i + gamma R; delta <- R - V(O_i). With
    ``gae_lambda`` below 1 the advantages are the usual exponential average of such deltas.
    """
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
