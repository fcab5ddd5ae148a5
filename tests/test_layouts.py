"""The layouts for RViz and Foxglove show topics and fields that there are."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from importlib import import_module

import pytest
import yaml

from cfnav_core.robot.topics import TOPICS
from tests.conftest import ROOT

BRINGUP = ROOT / "ros_ws/src/cfnav_bringup"
LAYOUT = BRINGUP / "foxglove/cfnav.json"
ROLES = (
    "image", "camera_info", "scan", "odom", "cmd_vel", "estimate", "decision", "episode", "map",
    "diagnostics", "markers",
)  # fmt: skip
SHOWN = {TOPICS[role].name.lstrip("/"): TOPICS[role].type for role in ROLES}


def words(value: object) -> Iterator[str]:
    """Every text in a JSON or YAML value, keys of mappings too."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield key
            yield from words(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from words(inner)
    elif isinstance(value, str):
        yield value


def panels(node: object) -> Iterator[str]:
    if isinstance(node, str):
        yield node
    else:
        yield from panels(node["first"])
        yield from panels(node["second"])


def test_every_panel_of_foxglove_is_placed_and_shows_what_there_is() -> None:
    layout = json.loads(LAYOUT.read_text())
    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])
    topics = {word.partition(".")[0][1:] for word in words(layout) if word.startswith("/")}
    assert topics == set(SHOWN) - {"policy/markers"}


@pytest.mark.ros
def test_every_plotted_field_is_in_its_message() -> None:
    pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")
    plotted = [w for w in words(json.loads(LAYOUT.read_text())) if w[:1] == "/" and "." in w]
    assert len(plotted) > 8
    for path in plotted:
        topic, *fields = path[1:].split(".")
        package, name = SHOWN[topic].split("/msg/")
        message = getattr(import_module(f"{package}.msg"), name)()
        for field in fields:
            message = getattr(message, field)


def test_rviz_shows_the_topics_that_a_namespace_moves() -> None:
    layout = yaml.safe_load((BRINGUP / "rviz/cfnav.rviz").read_text())
    displays = layout["Visualization Manager"]["Displays"]
    shown = {d["Topic"]["Value"] for d in displays if "Topic" in d}
    assert {topic[1:] for topic in shown} <= set(SHOWN)
    launch = (BRINGUP / "launch/robot.launch.py").read_text()
    moved = ast.literal_eval(re.search(r"^SHOWN = (\(.*\))$", launch, re.MULTILINE)[1])
    assert {f"/{TOPICS[role].name}" for role in moved} == shown
