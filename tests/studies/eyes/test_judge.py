"""AUC, recall and false alarms, worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from cfnav_core.task.vocabulary import CATEGORIES
from studies.eyes.judge import auc_of_clear, difference, judge

EVERY = np.ones(len(CATEGORIES), bool)
APPLE, MUG, BOOK = (CATEGORIES.index(name) for name in ("Apple", "Mug", "Book"))


def judged_columns(**columns):
    """Scores and labels of some categories; the others are not known and not shown."""
    n = len(next(iter(columns.values()))[0])
    scores, labels = np.full((n, len(CATEGORIES)), np.nan), np.zeros((n, len(CATEGORIES)), np.int8)
    for name, (score, label) in columns.items():
        scores[:, CATEGORIES.index(name)] = score
        labels[:, CATEGORIES.index(name)] = label
    return scores, labels


def test_auc_counts_pairs_and_leaves_out_the_unclear():
    scores = np.array([0.9, 0.4, 0.4, 0.1, 1.0])
    labels = np.array([1, 1, 0, 0, -1], np.int8)
    assert auc_of_clear(scores, labels) == pytest.approx(3.5 / 4)
    assert np.isnan(auc_of_clear(scores[:2], labels[:2]))


def test_figures_at_a_half():
    scores, labels = judged_columns(
        Apple=([0.9, 0.8, 0.6, 0.2, 0.7, 0.1], [1, 1, 1, 0, 0, 0]),
        Mug=([0.6, 0.4, 0.9, 0.1, 0.1, 0.1], [1, 1, -1, 0, 0, 0]),
    )
    found = judge(scores, labels, EVERY)
    assert found.auc == {"Apple": pytest.approx(8 / 9), "Mug": 1.0}
    assert found.categories == ("Apple",)  # two pictures show a Mug
    assert found.mean_auc == pytest.approx(8 / 9)
    assert found.asked == 2
    assert found.recall == pytest.approx(4 / 5)
    assert found.false_alarms == pytest.approx(1 / 6)
    assert found.precision == pytest.approx(4 / 5)
    for value, (low, high) in (
        (found.mean_auc, found.mean_auc_interval), (found.recall, found.recall_interval),
        (found.false_alarms, found.false_alarms_interval),
    ):  # fmt: skip
        assert low <= value <= high


def test_the_threshold_gives_the_recall_that_was_asked_for():
    scores, labels = judged_columns(
        Apple=([0.4, 0.3, 0.2, 0.1, 0.35, 0.0], [1, 1, 1, 1, 0, 0]),
    )
    found = judge(scores, labels, EVERY, recall=0.5)
    assert (found.threshold, found.recall) == (0.3, 0.5)
    assert found.false_alarms == pytest.approx(1 / 6)


def test_categories_that_are_not_asked_for_do_not_count():
    scores, labels = judged_columns(
        Apple=([0.9, 0.1], [1, 0]), Mug=([0.1, 0.9], [1, 0]),
    )  # fmt: skip
    only = np.arange(len(CATEGORIES)) == APPLE
    found = judge(scores, labels, only)
    assert (found.recall, found.false_alarms, set(found.auc)) == (1.0, 0.0, {"Apple"})


def test_the_difference_is_of_categories_that_both_know():
    label = [1, 1, 1, 0, 0, 0]
    first, labels = judged_columns(
        Apple=([3, 3, 3, 1, 1, 1], label), Mug=([1, 1, 1, 3, 3, 3], label)
    )
    second, _ = judged_columns(Apple=([1, 1, 1, 3, 3, 3], label))
    gain, (low, high) = difference(first, second, labels, EVERY)
    assert (gain, low, high) == (1.0, 1.0, 1.0)
