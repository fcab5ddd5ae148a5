"""docs/robot.md and the README's section on the robot name only what there is."""

from __future__ import annotations

import ast
import importlib.util
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import pytest
import tyro
from cfnav_ros.bags.playing import PlayOptions
from cfnav_ros.bags.roles import parse_topics
from cfnav_ros.bags.sources import SENSORS
from cfnav_ros.lidar import SweptDisc, estimate_collision
from cfnav_ros.limits import EpisodeLimits
from cfnav_ros.motion import Motion, MotionLimits, Odometry, Status
from cfnav_ros.policy_parameters import PolicyParameters
from cfnav_ros.scan_watch import LidarParameters
from cfnav_ros.settings import leaves

from cfnav_core.actions import Action
from cfnav_ros import bringup
from tests.conftest import ROOT
from tests.ros.lidar_scans import scan_of, wall_ahead

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


@pytest.mark.parametrize(
    "arguments", [args for module, args in python_modules() if module == "cfnav_ros.bag_play"]
)
def test_a_command_that_plays_a_bag_is_understood(arguments: tuple[str, ...]) -> None:
    options = tyro.cli(PlayOptions, args=arguments)
    options.check()
    assert set(parse_topics(options.topic, SENSORS)) | {*options.wait_for} <= SENSORS.keys()


def test_the_learning_command_runs(tmp_path: Path) -> None:
    (arguments,) = [args for module, args in python_modules() if module == "cfnav_ros.lidar_mask"]
    command = [sys.executable, "-m", "cfnav_ros.lidar_mask", *arguments]
    told = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=60)
    assert told.returncode == 2
    assert "out/turn does not exist" in told.stderr


def test_every_parameter_file_named_exists() -> None:
    named = set(re.findall(r"\b((?:turtlebot4|simulation)\w*\.yaml)", TEXT + README))
    assert named == {path.name for path in CONFIG.glob("*.yaml")} - {"simulation.yaml"}


def test_every_parameter_named_exists() -> None:
    known = {name for name, _ in leaves(PolicyParameters())}
    known |= {name for name, _ in leaves(LidarParameters())}
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
    for target in re.findall(r"\]\(([^)]+)\)", TEXT):
        file, _, anchor = target.partition("#")
        page = DOC.parent / file if file else DOC
        assert page.exists(), target
        headings = re.findall(r"^#+ (.+)$", page.read_text(), re.MULTILINE) if anchor else []
        anchors = {re.sub(r"[^\w -]", "", of).lower().replace(" ", "-") for of in headings}
        assert not anchor or anchor in anchors, target


@pytest.mark.ros
@pytest.mark.parametrize("name", ["policy", "lidar"])
def test_an_enclave_may_do_what_its_node_does(name: str, ros_domain_id: int) -> None:
    rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
    pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")
    from cfnav_ros.lidar_collision_node import LidarCollisionNode
    from cfnav_ros.policy_node import PolicyNode

    (row,) = re.findall(rf"^\| `/cfnav/{name}` \| (.+) \| (.+) \|$", TEXT, re.MULTILINE)
    told = [set(re.findall(r"`/?([\w/]+)`", cell)) for cell in row]
    rclpy.init(domain_id=ros_domain_id)
    try:
        node = PolicyNode() if name == "policy" else LidarCollisionNode()
        published = {publisher.topic_name[1:] for publisher in node.publishers}
        heard = {subscription.topic_name[1:] for subscription in node.subscriptions}
        node.destroy_node()
    finally:
        rclpy.try_shutdown()
    # The velocity and those who may send it too are known only when a robot is there.
    later = {"cmd_vel", "cmd_vel_unstamped", "other_publishers"} if name == "policy" else set()
    assert published - {"parameter_events"} == told[0] - later - {"rosout"}
    assert heard - {"oakd/rgb/preview/image_raw"} == told[1] - later


FIRST_DRIVE = TEXT.partition("## The first drive")[2].partition("\n## ")[0]
BODY_RADIUS = 0.171
"""m from the middle to the bumper: 342 mm long (TurtleBot 4 user manual, features)."""


def test_the_board_of_the_first_drive_is_vetoed_where_the_page_says_so() -> None:
    near = float(re.search(r"([\d.]+) m before the bumper", FIRST_DRIVE)[1])
    says = float(re.search(r"must say ([\d.]+)", FIRST_DRIVE)[1])
    far = float(re.search(r"A board ([\d.]+) m away", FIRST_DRIVE)[1])
    estimate, free = (
        estimate_collision(scan_of(wall_ahead(BODY_RADIUS + gap)), SweptDisc())
        for gap in (near, far)
    )
    assert estimate.probability >= EpisodeLimits().veto_probability > free.probability
    assert abs(estimate.clearance - says) < 0.02


def finish(limits: MotionLimits, action: Action) -> Status:
    """How a motion ends on a carpet: the base makes nine tenths of what is asked of it."""
    t, pose = 0.0, Odometry(0.0, 0.0, 0.0, 0.0)
    motion, status = Motion(action, t, pose, 0.0, limits), Status.DRIVING
    while status is Status.DRIVING:
        command, status = motion.update(t, pose)
        t += 0.05
        pose = Odometry(t, pose.x + 0.045 * command.v, 0.0, pose.yaw + 0.045 * command.w)
    return status


def test_motions_finish_at_the_speeds_of_the_first_drive() -> None:
    brakes, step = re.findall(r"^[23]\. .*$", FIRST_DRIVE, re.MULTILINE)
    for text in (brakes, step):
        told = re.findall(r"`episode\.motion\.(\w+): ([\d.]+)`", text)
        limits = MotionLimits(**{name: float(value) for name, value in told})
        assert limits.v_max < MotionLimits().v_max
        for action in (Action.MoveAhead, Action.RotateLeft):
            assert finish(limits, action) is Status.SUCCEEDED, (told, action)
