"""Detections by the names of their fields."""

from __future__ import annotations

import pytest

from cfnav_core.models.parts.reading import columns_of
from cfnav_core.task.detections import (
    BOXES,
    HULLS,
    SCORES,
    columns,
    confidence_column,
    fields_before_names,
    width,
)


@pytest.mark.parametrize(("fields", "columns"), [(SCORES, 5), (BOXES, 517), (HULLS, 4), ((), 0)])
def test_files_without_names_are_read_by_their_width(fields: tuple[str, ...], columns: int) -> None:
    assert width(fields) == columns
    assert fields_before_names(columns) == fields


def test_an_unknown_width_is_refused() -> None:
    with pytest.raises(ValueError, match="7 numbers without their names"):
        fields_before_names(7)


def test_a_block_has_its_width() -> None:
    assert columns(BOXES)["appearance"] == slice(0, 512)
    assert columns(BOXES)["confidence"] == slice(516, 517)


@pytest.mark.parametrize("fields", [("x", "x"), ("appearance*many",), ("*3",)])
def test_fields_that_make_no_sense_are_refused(fields: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="each name once"):
        columns(fields)


def test_models_read_fields_by_name_in_any_order() -> None:
    shuffled = ("area", "visible", "hue", "y", "x")
    columns = columns_of(shuffled)
    assert columns.columns == (1, 4, 3, 0)
    assert columns.confidence == confidence_column(shuffled) == 1
    assert columns.widths == (5, 5, 4)


@pytest.mark.parametrize("fields", [("x", "y"), ("score", "x", "y"), ()])
def test_fields_that_do_not_say_enough_are_refused(fields: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="expected one of these sets"):
        columns_of(fields)
