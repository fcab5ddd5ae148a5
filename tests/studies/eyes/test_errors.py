"""Errors that were put in are found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cfnav_core.detect.errors import ErrorModel, Recall, Thing
from cfnav_core.perception.boxes import Detection
from studies.eyes.errors import KNOWN, Said, fitted, rows

SIZE, DEGREE = (448, 252), 6.0
TRUE = ErrorModel(
    Recall(-4.0, 0.8, 1.5, -0.4, {"Chair": 1.0, "Mug": -1.0}), 0.3, (2.0, 3.0), (1.0, 4.0), 0.05,
    0.4 / len(KNOWN), 0.1, {"Mug": {"Bowl": 1.0}},
)  # fmt: skip


def drawn(pictures: int, of: ErrorModel = TRUE) -> Said:
    """What a detector with these errors says of things anywhere."""
    rng, said = np.random.default_rng(0), Said()
    for _ in range(pictures):
        wide, high = rng.uniform(15, 150, 2)
        left, top = rng.uniform(0, [SIZE[0] - wide, SIZE[1] - high])
        box = (left, top, left + wide, top + high)
        name = str(rng.choice(["Chair", "Mug", "Vase"]))
        thing = Thing(name, box, rng.uniform(0.2, 1), rng.uniform(0.5, 4))
        told = [one for one, _ in of.says([thing], KNOWN, SIZE, DEGREE, rng)]
        said.add([thing], told, DEGREE)
    return said


@pytest.fixture(scope="module")
def said() -> Said:
    return drawn(6000)


def test_what_was_put_in_is_found_again(said: Said) -> None:
    better = replace(TRUE, recall=replace(TRUE.recall, base=-3.0))
    made = fitted(said, drawn(3000, better))
    assert made.recall.base == pytest.approx(-3.0, abs=0.3)
    assert made.recall.size == pytest.approx(TRUE.recall.size, abs=0.15)
    assert made.recall.share == pytest.approx(TRUE.recall.share, abs=0.35)
    assert made.recall.distance == pytest.approx(TRUE.recall.distance, abs=0.1)
    apart = made.recall.names["Chair"] - made.recall.names["Mug"]
    assert apart == pytest.approx(2.0, abs=0.3)
    assert made.found == pytest.approx(TRUE.found, rel=0.2)
    assert made.jitter == pytest.approx(TRUE.jitter, rel=0.15)
    assert made.false_alarms == pytest.approx(TRUE.false_alarms, rel=0.15)
    assert made.confused == pytest.approx(TRUE.confused, abs=0.03)
    assert max(made.confusions["Mug"], key=made.confusions["Mug"].__getitem__) == "Bowl"


def test_the_table_counts_every_thing(said: Said) -> None:
    lines = [row.split(" | ") for row in rows(said)][2:]
    of_sides = [int(line[3]) for line in lines if "side" in line[0]]
    assert sum(of_sides) == len(said.things)


def test_too_little_is_no_measurement() -> None:
    with pytest.raises(ValueError, match="expected 10 or more of each"):
        fitted(drawn(5), drawn(5))


def test_each_box_is_the_best_of_one_thing_of_its_name() -> None:
    """A book lies on a laptop, and the detector finds the laptop only."""
    book, laptop = (100.0, 100.0, 160.0, 150.0), (95.0, 95.0, 165.0, 160.0)
    said = Said()
    things = [Thing("Book", book, 1.0, 1.0), Thing("Laptop", laptop, 1.0, 1.0)]
    said.add(things, [Detection("Laptop", 0.9, laptop)], DEGREE)
    assert said.found == [False, True]
    assert not said.confused


def test_a_poor_box_is_no_false_alarm_and_one_elsewhere_is() -> None:
    said = Said()
    things = [Thing("Mug", (100.0, 100.0, 160.0, 160.0), 1.0, 1.0)]
    poor, elsewhere = (130.0, 100.0, 190.0, 160.0), (300.0, 10.0, 340.0, 60.0)
    claims = [Detection("Mug", 0.5, poor), Detection("Mug", 0.4, elsewhere)]
    said.add(things, claims, DEGREE)
    assert (said.found, said.alarms) == ([False], [0.4])
    said.add(things, claims, DEGREE, unclear=["Mug"])
    assert said.alarms == [0.4]
