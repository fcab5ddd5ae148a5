"""Networks judged on rendered pictures."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from cfnav_core.perception.judge import agreement, counted, shown_in
from cfnav_core.perception.net import PerceptionNet, export_perception
from cfnav_core.perception.sight import Sight
from cfnav_core.task.calibration import auc
from cfnav_core.task.intervals import FEW
from cfnav_core.task.vocabulary import CATEGORIES
from studies.eyes.rendered import (
    TIMES,
    RenderedOptions,
    by_category,
    by_pixels,
    judged,
    main,
    near_recall,
)
from tests.core.perception.made import SMALL, picture_set

MUG = CATEGORIES.index("Mug")


def room(near):
    """Scores and truth of 20 pictures: a mug is near in the first half."""
    scores = np.zeros((20, len(CATEGORIES)))
    scores[:, MUG] = near
    truth = np.zeros(scores.shape, bool)
    truth[:10, MUG] = True
    return scores, scores, truth, truth


def test_figures_are_those_of_all_pictures_and_vary_over_rooms():
    sure, wrong = [0.9] * 10 + [0.1] * 10, [0.1] * 10 + [0.9] * 10
    said = judged([room(sure)])
    assert (said["shown_auc_mean"], said["near_auc_mean"], said["near_f1"]) == (1, 1, 1)
    assert said["interval"] is None  # one room tells nothing of others
    both = judged([room(sure), room(wrong)] * (FEW // 2))
    assert both["near_f1"] == pytest.approx(0.5)
    low, high = both["interval"]["near_f1"]
    assert 0.2 < low < 0.5 < high < 0.8
    assert both["near_f1_by_category"] == both["shown_auc_by_category"] == {"Mug": 0.5}
    assert (said["false_alarms"], both["false_alarms"]) == (0, 0.25)
    lines = by_category([{"perception": "a", "furniture": "b", **both}]).splitlines()
    assert (lines[0], lines[-1]) == ("| AUC of shown | a, b |", "| Mug | 0.50 |")


def test_what_is_taken_to_be_near_is_further_away_or_not_there_at_all():
    scores, _, is_shown, is_near = room([0.9] * 20)  # half of it is near
    is_shown = is_shown.copy()
    is_shown[10:15, MUG] = True  # a quarter is shown and further away
    said = judged([(scores, scores, is_shown, is_near)])
    assert (said["near_but_far"], said["near_ap"]) == (0.25, 0.5)


def test_what_is_seen_small_is_told_apart_from_what_is_seen_large():
    small, large = room([0.1] * 20), room([0.9] * 20)
    times = np.zeros((20, len(CATEGORIES)))
    times[:10, MUG] = 3
    found = near_recall([small, large], [times, times * 30])
    assert [row["things"] for row in found] == [0, 10, 0, 0, 10]
    assert [row["recall"] for row in found] == [None, 0, None, None, 1]
    text = by_pixels([{"perception": "a", "furniture": "b", "near_recall": found}])
    lines = [line.strip("|").split("|") for line in text.splitlines()[2:]]
    assert [[cell.strip() for cell in line] for line in lines] == [
        ["1 to 2", ""], ["2 to 4", "0.00 of 10"], ["4 to 8", ""], ["8 to 32", ""],
        [f"{TIMES[-1]} and more", "1.00 of 10"],
    ]  # fmt: skip


def test_some_pictures_are_judged_by_the_categories_that_count_in_all():
    every = room([0.9] * 10 + [0.1] * 10)
    some = tuple(table[5:] for table in every)  # where a mug is too seldom to count by itself
    assert counted(every[3]).tolist() == [MUG]
    assert np.isnan(agreement(*some)["near_auc_mean"])
    among = counted(every[2]), counted(every[3])
    assert agreement(*some, among=among)["near_auc_mean"] == 1


def test_auc_without_both_kinds_is_none():
    assert np.isnan(auc(np.ones(3), np.ones(3, bool)))


def test_a_thing_is_shown_from_twelve_pixels_of_a_cell():
    heat = np.zeros((2, 3, 3, 1), np.uint8)
    heat[0, 1, 1, 0], heat[1, :, :, 0] = 12, 11
    assert shown_in(heat).tolist() == [[True], [False]]


def test_networks_are_judged_by_furniture(tmp_path, capsys):
    picture_set(tmp_path / "sets", 1000)
    picture_set(tmp_path / "sets", 1001, kind="sweet_home.kitchen")
    export_perception(PerceptionNet(sight=Sight.of(SMALL)), tmp_path / "p.onnx", camera=SMALL)
    main(RenderedOptions(tmp_path / "sets", (tmp_path / "p.onnx",), tmp_path / "found.json"))
    networks = json.loads((tmp_path / "found.json").read_text())["networks"]
    assert [(row["furniture"], row["pictures"]) for row in networks] == [
        ("built_in", 24), ("sweet_home", 24),
    ]  # fmt: skip
    assert "| built_in | 1 | 24 |" in capsys.readouterr().out


def test_what_does_not_fit_is_one_sentence(tmp_path):
    with pytest.raises(ValueError, match="found no picture set in"):
        main(RenderedOptions(tmp_path))
    picture_set(tmp_path, 1000)
    with pytest.raises(ValueError, match=r"found pictures of .*0\.3 m up.* in .*, expected .*1\.3"):
        main(RenderedOptions(tmp_path))
    higher = replace(SMALL, z=0.5)  # pictures as large
    export_perception(PerceptionNet(sight=Sight.of(higher)), tmp_path / "p.onnx", camera=higher)
    with pytest.raises(ValueError, match=r"0\.3 m up.* expected .*0\.5 m up.* of this camera"):
        main(RenderedOptions(tmp_path, (tmp_path / "p.onnx",)))


def test_few_pictures_have_figures_without_means(tmp_path, capsys):
    picture_set(tmp_path / "sets", 1000, count=5)
    export_perception(PerceptionNet(sight=Sight.of(SMALL)), tmp_path / "p.onnx", camera=SMALL)
    main(RenderedOptions(tmp_path / "sets", (tmp_path / "p.onnx",), tmp_path / "found.json"))

    def no_number(word):
        raise AssertionError(word)

    said = json.loads((tmp_path / "found.json").read_text(), parse_constant=no_number)
    assert said["networks"][0]["shown_auc_mean"] is None
    assert "| built_in | 1 | 5 | nan |" in capsys.readouterr().out
