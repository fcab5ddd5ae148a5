"""The study of attacks: its table, and one real attack."""

import json

import pytest

pytestmark = pytest.mark.ros
pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")
pytest.importorskip("torch", reason="making a bundle needs torch: run 'make test'")

from studies.deploy import attacks  # noqa: E402
from studies.deploy.attacks import ATTACKS, AttackConfig, measure, table  # noqa: E402


def test_a_line_tells_of_all_runs_of_an_attack():
    row = {"attack": ATTACKS[-1].words, "contacts": 1, "message": "policy_node also publishes."}
    rows = [
        {**row, "ended_s": 0.3, "moved_s": 0.5},
        {**row, "ended_s": None, "moved_s": 15.0, "message": "", "outcome": "drives on"},
    ]
    (line,) = table(rows).splitlines()[2:]
    assert line == (
        "| drives ahead as a node named policy_node, 20 Hz | 2 | 2 | 0.30, at most 0.30 "
        "| 7.75, at most 15.00 | drives on / policy_node also publishes. |"
    )


@pytest.mark.long
def test_who_says_that_nothing_is_there_is_named_and_not_believed(tmp_path, monkeypatch):
    monkeypatch.setattr(attacks, "ATTACKS", ATTACKS[:1])
    (row,) = measure(AttackConfig(tmp_path, runs=1, graphs=1))
    assert row["contacts"] == 0
    assert row["message"].startswith("2 nodes publish /collision/estimate (")
    assert json.loads((tmp_path / "attacks.json").read_text()) == [row]
