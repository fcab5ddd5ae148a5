"""docs/robot.md and the README's section on the robot name only what there is."""

from __future__ import annotations

import ast
import importlib.util
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest
from cfnav_ros.lidar import SweptDisc

from cfnav_ros import bringup
from tests.conftest import ROOT

DOC = ROOT / "docs/robot.md"
TEXT = DOC.read_text()
README = (ROOT / "README.md").read_text().partition("## On the real robot")[2].partition("\n## ")[0]
CONFIG = ROOT / "ros_ws/src/cfnav_bringup/config"


def commands(text: str) -> Iterator[str]:
    """Every command line in a block or in a line of text."""
    for block in re.findall(r"```bash\n(.*?)```", text, re.DOTALL):
        yield from block.splitlines()
    yield from re.findall(r"`([a-z][^`\n]* [^`\n]*)`", re.sub(r"```.*?```", "", text, flags=re.S))


def python_modules() -> list[tuple[str, tuple[str, ...]]]:
    found = re.findall(r"python -m (\S+)([^#`\n]*)", "\n".join(commands(TEXT + README)))
    return [(module, tuple(shlex.split(arguments))) for module, arguments in found]


def source_texts() -> list[str]:
    """Every text that the code of the robot holds, pieces of f-strings for themselves."""
    texts = []
    for file in (ROOT / "cfnav_ros/cfnav_ros").glob("*.py"):
        nodes = ast.walk(ast.parse(file.read_text()))
        texts += [
            n.value for n in nodes if isinstance(n, ast.Constant) and isinstance(n.value, str)
        ]
    return texts


def test_every_module_and_make_target_exists() -> None:
    modules = python_modules()
    assert len(modules) >= 6
    for module, _ in modules:
        assert importlib.util.find_spec(module), module
    makefile = (ROOT / "Makefile").read_text()
    for target in re.findall(r"\bmake ([a-z-]+)", "\n".join(commands(TEXT + README))):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


@pytest.mark.parametrize(
    "arguments", [args for module, args in python_modules() if module == "cfnav_ros.bringup"]
)
def test_a_bringup_command_is_understood(arguments: tuple[str, ...]) -> None:
    config = bringup.parse(arguments)
    assert (CONFIG / config.params).is_file()


def test_the_learning_command_runs(tmp_path: Path) -> None:
    (arguments,) = [args for module, args in python_modules() if module == "cfnav_ros.lidar_mask"]
    command = [sys.executable, "-m", "cfnav_ros.lidar_mask", *arguments]
    told = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=60)
    assert told.returncode == 2
    assert "out/turn does not exist" in told.stderr


def test_every_parameter_file_named_exists() -> None:
    named = set(re.findall(r"\b((?:turtlebot4|simulation)\w*\.yaml)", TEXT + README))
    assert named == {path.name for path in CONFIG.glob("*.yaml")} - {"simulation.yaml"}


def parameter_names(kind: object, prefix: str = "") -> Iterator[str]:
    for field in fields(kind):
        value = getattr(kind, field.name)
        if is_dataclass(value):
            yield from parameter_names(value, f"{prefix}{field.name}.")
        else:
            yield prefix + field.name


def test_every_parameter_named_exists() -> None:
    parameters = pytest.importorskip("cfnav_ros.parameters", reason="needs ROS 2")
    known = set(parameter_names(parameters.PolicyParameters()))
    known |= set(parameter_names(parameters.LidarParameters()))
    named = set(re.findall(r"`((?:episode|disc|motion)\.[\w.]+)", TEXT))
    assert len(named) > 6
    assert named <= known
    assert {name.partition(".")[2] for name in named if name.startswith("disc.")} <= {
        field.name for field in fields(SweptDisc)
    }


def test_every_sentence_of_the_table_is_said_by_the_code() -> None:
    rows = re.findall(
        r"^\| `([^`]+)` \|", TEXT.partition("## What preflight says")[2], re.MULTILINE
    )
    assert len(rows) > 10
    texts = source_texts()
    for row in rows[: rows.index("/cfnav/policy")] if "/cfnav/policy" in rows else rows:
        for piece in filter(str.strip, row.split("…")):
            assert any(piece.strip(" .;:") in text for text in texts), (row, piece)


def test_every_link_leads_somewhere() -> None:
    headings = re.findall(r"^## (.+)$", TEXT, re.MULTILINE)
    anchors = {re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings}
    for target in re.findall(r"\]\(([^)]+)\)", TEXT):
        if target.startswith("#"):
            assert target[1:] in anchors, target
        else:
            assert (DOC.parent / target).exists(), target
