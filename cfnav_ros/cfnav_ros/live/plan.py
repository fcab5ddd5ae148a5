"""Which goals are sought in which rooms: the same seed gives the same trials. Pure."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Trial:
    """One episode to run; ``seed`` draws the start pose."""

    room: str
    goal: str
    seed: int


def parse_list(text: str) -> tuple[str, ...]:
    """Split a comma-separated list; blanks around the words and empty words do not count."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def chosen_trials(
    goals_of: Mapping[str, Sequence[str]], goals: Sequence[str], seed: int
) -> Iterator[Trial]:
    """Yield each room with each of the goals it has, again and again with further seeds.

    Args:
        goals_of: the goals of each room.
        goals: the goals asked for.
        seed: seed of the first round; each further round adds one.

    Raises:
        ValueError: a goal that none of the rooms has.
    """
    for goal in goals:
        if not any(goal in known for known in goals_of.values()):
            rooms = "; ".join(f"{room} has {', '.join(has)}" for room, has in goals_of.items())
            raise ValueError(f"goal {goal!r} is in none of the rooms: {rooms}")
    pairs = [(room, goal) for room, has in goals_of.items() for goal in goals if goal in has]
    return (Trial(room, goal, seed + turn) for turn in itertools.count() for room, goal in pairs)


def drawn_trials(goals_of: Mapping[str, Sequence[str]], seed: int) -> Iterator[Trial]:
    """Yield trials without end: rooms in turn, goals of each in an order drawn from the seed."""
    orders = {
        room: np.random.default_rng([seed, number]).permutation(sorted(goals)).tolist()
        for number, (room, goals) in enumerate(goals_of.items())
    }
    for turn in itertools.count():
        for room, order in orders.items():
            yield Trial(room, order[turn % len(order)], seed + turn)
