"""What a synchronous run carries from round to round besides its weights, as named tensors.

Episodes under way, what the networks remember of them, and the random streams. With them a run
that goes on from a checkpoint does what it would have done.
"""

from __future__ import annotations

import json

import torch
from torch import Tensor

from cfnav_core.agent.reward import RewardMemory
from cfnav_core.learn.algorithm import Learner

ROWS, STREAMS = "rows.", "streams."


def carried(learner: Learner) -> dict[str, Tensor]:
    """Take it, on the CPU. All ranks call this, and get the rows of all.

    Returns:
        ``ROWS``: [B of all ranks, ...] each, in their order. ``STREAMS``: uint8, states of
        generators; those that every rank has of its own [ranks, bytes].
    """
    env, ranks = learner.env, learner.ranks
    said = json.dumps(env.rng.bit_generator.state).encode()
    streams = {
        "episodes": torch.frombuffer(bytearray(said), dtype=torch.uint8),
        "actions": learner.generator.get_state(),
        "cpu": ranks.joined(torch.get_rng_state()[None]),
    }
    if env.device.type == "cuda":
        streams["cuda"] = ranks.joined(torch.cuda.get_rng_state(env.device)[None])
    rows = {name: ranks.joined(own) for name, own in _rows(learner).items()}
    return {ROWS + k: v for k, v in rows.items()} | {STREAMS + k: v for k, v in streams.items()}


def put_back(learner: Learner, kept: dict[str, Tensor]) -> bool:
    """Go on from what ``carried`` took; changes nothing where it does not fit.

    Noise of networks (dropout) goes on where there are as many ranks as before, on such devices.

    Returns:
        Whether it fits: as many episodes, in scenes of as many states.
    """
    env, memory, ranks = learner.env, learner.memory, learner.ranks
    rows = {k.removeprefix(ROWS): v for k, v in kept.items() if k.startswith(ROWS)}
    wanted = {k: (env.part.total, *v.shape[1:]) for k, v in _rows(learner).items()}
    if {k: tuple(v.shape) for k, v in rows.items()} != wanted:
        return False
    if int(rows["env.state"].max()) >= len(env.bank.scene):
        return False
    own = {k: env.part.rows(v).to(env.device) for k, v in rows.items()}
    for name in ("state", "goal", "steps", "collisions"):
        setattr(env, name, own[f"env.{name}"])
    memory.policy = {k: own[f"policy.{k}"] for k in memory.policy}
    memory.predictor, memory.previous_action = own["predictor"], own["previous_action"]
    memory.reward = RewardMemory(own["reward.seen_parents"], own["reward.best_similarity"])
    env.rng.bit_generator.state = json.loads(bytes(kept[STREAMS + "episodes"].numpy()))
    learner.generator.set_state(kept[STREAMS + "actions"])
    if len(kept[STREAMS + "cpu"]) == ranks.size:
        torch.set_rng_state(kept[STREAMS + "cpu"][ranks.rank].clone())
        if env.device.type == "cuda" and STREAMS + "cuda" in kept:
            torch.cuda.set_rng_state(kept[STREAMS + "cuda"][ranks.rank].clone(), env.device)
    return True


def _rows(learner: Learner) -> dict[str, Tensor]:
    """One's own rows, [B, ...] each."""
    env, memory = learner.env, learner.memory
    return {
        "env.state": env.state, "env.goal": env.goal, "env.steps": env.steps,
        "env.collisions": env.collisions,
        **{f"policy.{k}": v for k, v in memory.policy.items()},
        "predictor": memory.predictor, "previous_action": memory.previous_action,
        "reward.seen_parents": memory.reward.seen_parents,
        "reward.best_similarity": memory.reward.best_similarity,
    }  # fmt: skip
