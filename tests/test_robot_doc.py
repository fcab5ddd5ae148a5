"""docs/robot.md and the README's section on the robot name only what there is."""

from __future__ import annotations

import ast
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import pytest
import tyro
import yaml
from cfnav_ros.bags.files.playing import PlayOptions
from cfnav_ros.bags.files.roles import parse_topics
from cfnav_ros.bags.files.sources import SENSORS
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.drive.motion import Motion, MotionLimits, Odometry, Status
from cfnav_ros.drive.policy_parameters import PolicyParameters
from cfnav_ros.lidar.estimate import SweptDisc, estimate_collision
from cfnav_ros.lidar.scan_watch import LidarParameters
from cfnav_ros.live.bringup import RobotBringup, SimulationBringup

from cfnav.cli import COMMANDS
from cfnav_core.robot.robot import load_robot, robots
from cfnav_core.robot.settings import leaves
from cfnav_core.robot.topics import TOPICS
from cfnav_core.task.actions import Action
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


def cfnav_commands() -> list[tuple[str, tuple[str, ...]]]:
    """Name and arguments of every ``cfnav`` command line; a bare name stands for the command."""
    lines = re.findall(r"(?:^| )cfnav ([a-z][^#`\n]*)", "\n".join(commands(TEXT + README)), re.M)
    found = []
    for words in map(shlex.split, lines):
        name = " ".join(words[:2]) if " ".join(words[:2]) in COMMANDS else words[0]
        found.append((name, tuple(words[len(name.split()) :])))
    return found


def of(name: str) -> list[tuple[str, ...]]:
    return [arguments for found, arguments in cfnav_commands() if found == name and arguments]


def source_texts() -> list[str]:
    """Every text that the code of the robot holds, pieces of f-strings for themselves."""
    texts = []
    for file in (ROOT / "cfnav_ros/cfnav_ros").rglob("*.py"):
        nodes = ast.walk(ast.parse(file.read_text()))
        texts += [
            n.value for n in nodes if isinstance(n, ast.Constant) and isinstance(n.value, str)
        ]
    return texts


def test_every_command_and_make_target_exists() -> None:
    names = [name for name, _ in cfnav_commands()]
    assert len(names) >= 6
    assert [name for name in names if name not in COMMANDS] == []
    makefile = (ROOT / "Makefile").read_text()
    for target in re.findall(r"\bmake ([a-z-]+)", "\n".join(commands(TEXT + README))):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


@pytest.fixture(scope="module")
def own_robot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The copy of a robot's file that a line of the page makes."""
    made = tmp_path_factory.mktemp("copy") / "mine.yaml"
    (line,) = re.findall(r"^sed .* > mine\.yaml$", TEXT, re.M)
    subprocess.run(line.replace("> mine.yaml", f"> {made}"), shell=True, check=True, cwd=ROOT)
    return made


@pytest.mark.parametrize(
    ("options", "arguments"),
    [(RobotBringup, arguments) for arguments in of("robot")]
    + [(SimulationBringup, arguments) for arguments in of("simulate")],
)
def test_a_bringup_command_is_understood(
    options: type, arguments: tuple[str, ...], own_robot: Path
) -> None:
    config = tyro.cli(options, args=arguments)
    assert (CONFIG / config.params).is_file()
    if config.robot == own_robot.name:
        assert load_robot(own_robot).topics["detections"].name == "oakd/nn/detections"
    else:
        assert load_robot(config.robot).name in robots()


@pytest.mark.parametrize("arguments", of("bag play"))
def test_a_command_that_plays_a_bag_is_understood(arguments: tuple[str, ...]) -> None:
    options = tyro.cli(PlayOptions, args=arguments)
    options.check()
    assert set(parse_topics(options.topic, SENSORS)) | {*options.wait_for} <= SENSORS.keys()


def test_the_learning_command_runs(tmp_path: Path) -> None:
    (arguments,) = of("bag mask")
    command = [sys.executable, "-m", "cfnav.cli", "bag", "mask", *arguments]
    told = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=300)
    assert told.returncode == 2
    assert "out/turn does not exist" in told.stderr


def test_every_robot_and_parameter_file_named_exists() -> None:
    named = set(re.findall(r"\b(turtlebot4\w*|differential)\b", TEXT + README))
    assert named - {"turtlebot4_bringup"} == set(robots())
    assert "config/robot.yaml`" in TEXT
    assert (CONFIG / "robot.yaml").is_file()


def test_the_page_names_the_inputs_of_its_multiplexer() -> None:
    said = yaml.safe_load((CONFIG / "other_nodes/twist_mux.yaml").read_text())
    inputs = said["/**/twist_mux"]["ros__parameters"]["topics"].values()
    beside = TEXT.partition("## Beside Nav2")[2].partition("\n## ")[0]
    assert {row["topic"] for row in inputs} == set(
        re.findall(r"\bcmd_vel_(?!out|topic)\w+", beside)
    )
    by_hand, nav2, cfnav = sorted((row["priority"], row["topic"]) for row in inputs)[::-1]
    assert (by_hand[1], nav2[1], cfnav[1]) == ("cmd_vel_joy", "cmd_vel_nav2", "cmd_vel_cfnav")


def test_every_parameter_named_exists() -> None:
    known = {name for name, _ in leaves(PolicyParameters())}
    known |= {name for name, _ in leaves(LidarParameters())}
    named = set(re.findall(r"`((?:episode|disc|motion|depth)\.[\w.]+)", TEXT))
    assert len(named) > 6
    assert named <= known
    assert {name.partition(".")[2] for name in named if name.startswith("disc.")} <= {
        field.name for field in fields(SweptDisc)
    }


def told_rows() -> list[str]:
    """Sentences of the table of what preflight says."""
    table = TEXT.partition("## What preflight says")[2]
    return re.findall(r"^\| `([^`]+)` \|", table, re.MULTILINE)


def test_every_sentence_of_the_table_is_said_by_the_code() -> None:
    rows = told_rows()
    assert len(rows) > 10
    texts = source_texts()
    for row in rows[: rows.index("/cfnav/policy")] if "/cfnav/policy" in rows else rows:
        for piece in filter(str.strip, row.split("…")):
            assert any(piece.strip(" .;:") in text for text in texts), (row, piece)


def test_every_sentence_about_who_speaks_is_in_the_table() -> None:
    file = ROOT / "cfnav_ros/cfnav_ros/robot/speakers.py"
    told = [node for node in ast.walk(ast.parse(file.read_text())) if type(node) is ast.JoinedStr]
    texts = [
        "".join(str(p.value) if isinstance(p, ast.Constant) else "…" for p in node.values)
        for node in told
    ]
    sentences = {text for text in texts if text.endswith(".")}
    assert len(sentences) > 2
    assert sentences - set(told_rows()) == set()


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
    from cfnav_ros.ros.lidar_collision_node import LidarCollisionNode
    from cfnav_ros.ros.policy_node import PolicyNode

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
    # The velocity and those who may send it too are known only when a robot is there; odometry is
    # heard from the first picture of depth on.
    driving = {"cmd_vel", "cmd_vel_unstamped", "other_publishers"}
    later = {"policy": driving, "lidar": {"odom"}}[name]
    assert published - {"parameter_events"} == told[0] - later - {"rosout"}
    camera = {TOPICS[role].name for role in ("image", "camera_info")}
    assert heard - camera == told[1] - later


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
