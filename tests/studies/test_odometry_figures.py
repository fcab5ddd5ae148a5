"""The study of odometry judges drives whose way and touches it knows."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from studies.bags.odometry_figures import (
    FAR,
    FORGETS,
    SETTINGS,
    WALL_M,
    Setting,
    figure,
    motion,
    report,
)


def test_the_base_stops_at_the_wall_and_where_it_forgets() -> None:
    free, wall = motion(Setting()), motion(Setting(wall=True))
    assert free[-1, 0] == pytest.approx(1.2, abs=0.005)
    assert wall[-1, 0] == WALL_M
    spurts = motion(Setting(command_hz=1.0, memory_s=FORGETS))
    assert spurts[-1, 0] == pytest.approx(0.6, abs=0.03)
    assert max(abs(b - a) for a, b in zip(spurts[:-1, 1], spurts[1:, 1], strict=True)) < 0.001


def test_a_row_has_what_was_found_of_both_drives() -> None:
    sound, two = Setting(), Setting(sources=FAR)
    pairs = [(figure(s, 1), figure(replace(s, wall=True), 1)) for s in (sound, two)]
    assert [pair[1].touches for pair in pairs] == [(1,), (None,)]
    rows = [line.strip("| ").split(" | ") for line in report(pairs).splitlines()[2:]]
    assert rows[0] == ["20 Hz", "20 Hz", "0", "0", "0", "1"]
    assert rows[1] == [f"20 Hz, {FAR}", "20 Hz", *["unknown"] * 4]


def test_the_study_covers_rates_noise_commands_and_sources() -> None:
    assert len(SETTINGS) == len(set(SETTINGS)) > 41
    assert {s.odometry_hz for s in SETTINGS} >= {1, 20, 200}
    assert max(s.noise_m for s in SETTINGS) == 0.01
    assert any(not math.isinf(s.memory_s) for s in SETTINGS)
