"""The ``cfnav`` command: what it lists, how it ends, what it says where something is missing."""

from __future__ import annotations

import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from cfnav import cli
from cfnav_core.command import CannotError, command_line, ending, read_options
from cfnav_core.policy.bundle import SHIPPED
from tests.conftest import ROOT
from tests.core.worlds import hall

NODES = [name for name in cli.COMMANDS if name.startswith("node ")]
NEED_ROS = [*NODES, "bag play"]


@pytest.fixture
def cfnav(monkeypatch, capsys):
    """Runs a command line in this process; returns exit code, standard output and error."""

    def run(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["cfnav", *words])
        before = [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)]
        try:
            code = cli.main()
        except SystemExit as end:
            code = end.code
        finally:
            for number, handler in zip((signal.SIGINT, signal.SIGTERM), before, strict=True):
                signal.signal(number, handler)
        return code, *capsys.readouterr()

    return run


@pytest.mark.parametrize("words", [(), ("--help",), ("-h",)])
def test_help_lists_every_command_and_the_exit_codes(cfnav, words):
    code, out, _ = cfnav(*words)
    assert code == 0
    listed = re.findall(r"^  (\S+(?: \S+)?)  ", out, re.MULTILINE)
    assert listed == list(cli.COMMANDS)
    assert "0 done; 1 done in part, or judged unfavourably; 2 could not; 130 told to stop" in out
    assert max(map(len, out.splitlines())) <= 100


def test_a_group_lists_its_own(cfnav):
    for words in (("bag",), ("bag", "--help")):
        code, out, _ = cfnav(*words)
        assert code == 0
        assert re.findall(r"^  bag (\S+)", out, re.MULTILINE) == ["eval", "play", "mask"]
        assert "rooms make" not in out


@pytest.mark.parametrize(
    ("words", "name", "meant"),
    [
        (("trainn",), "trainn", "train"),
        (("bag", "evl"), "bag evl", "bag eval"),
        (("fly",), "fly", ""),
    ],
)
def test_an_unknown_command_is_one_sentence(cfnav, words, name, meant):
    code, out, err = cfnav(*words)
    hint = f" (did you mean {meant}?)" if meant else ""
    assert (code, out) == (2, "")
    assert err == f"cfnav: found command '{name}'{hint}, expected one that cfnav --help lists\n"


def test_the_version(cfnav):
    assert cfnav("--version")[:2] == (0, "cfnav 0.1.0\n")


@pytest.mark.parametrize("name", [name for name in cli.COMMANDS if name not in NEED_ROS])
def test_help_of_a_command_says_what_it_does_and_takes(cfnav, name):
    code, out, _ = cfnav(*name.split(), "--help")
    assert code == 0
    assert out.startswith(f"usage: cfnav {name} ")
    assert len(out.splitlines()[2]) > 20  # a sentence of its own
    module, _, options = cli.COMMANDS[name].where.partition(":")
    assert callable(getattr(import_module(module), options).run_command)


@pytest.mark.ros
@pytest.mark.parametrize("name", NEED_ROS)
def test_help_of_a_node(cfnav, name):
    pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
    code, out, _ = cfnav(*name.split(), "--help")
    assert code == 0
    assert len(out) > 60


def test_help_loads_next_to_nothing():
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-X", "importtime", "-m", "cfnav.cli", "--help"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    loaded = {line.split("|")[-1].strip() for line in done.stderr.splitlines()}
    assert not {"numpy", "tyro", "torch", "mujoco", "rclpy", "gymnasium"} & loaded
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 0.3


@pytest.mark.parametrize(
    ("outcome", "code", "sentence"),
    [
        (None, 0, ""), (0, 0, ""), (1, 1, ""), (2, 2, ""),
        (ValueError("bad"), 2, "it: bad\n"), (OSError("full"), 2, "it: full\n"),
        (CannotError("no"), 2, "it: no\n"),
        (KeyboardInterrupt(), 130, "it: interrupted; every process was ended\n"),
        (KeyboardInterrupt("stopped after 3"), 130, "it: stopped after 3\n"),
        (ImportError("no GL library"), 2, "it: no GL library\n"),
        (ModuleNotFoundError(name="onnx.helper"), 2,
         "it: found no onnx, which this needs; install it with pip install 'cfnav[train]'\n"),
        (ModuleNotFoundError(name="mcap"), 2,
         "it: found no mcap, which this needs; install it with pip install mcap\n"),
    ],
)  # fmt: skip
def test_how_a_command_ends(monkeypatch, capsys, outcome, code, sentence):
    monkeypatch.setattr("cfnav_core.command.INTERRUPT.catch", lambda: None)

    def work() -> int | None:
        if isinstance(outcome, BaseException):
            raise outcome
        return outcome

    assert ending("it", work) == code
    assert capsys.readouterr().err == sentence


def test_a_mistake_of_ours_stays_a_traceback(monkeypatch):
    monkeypatch.setattr("cfnav_core.command.INTERRUPT.catch", lambda: None)
    with pytest.raises(ZeroDivisionError):
        ending("it", lambda: 1 // 0)


@pytest.mark.parametrize(
    ("argv", "told"),
    [(["/usr/bin/cfnav", "bag", "eval", "a b"], "cfnav bag eval 'a b'"),
     (["/lib/bag_eval", "x"], "bag_eval x")],
)  # fmt: skip
def test_the_command_as_somebody_would_type_it(monkeypatch, argv, told):
    monkeypatch.setattr(sys, "argv", argv)
    assert command_line() == told


HIDE = """
import os, sys
class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in os.environ["HIDDEN"].split(","):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Hidden())
"""
TRAIN = "install it with pip install 'cfnav[train]'"
ROS = "it is part of ROS 2 Jazzy or of the workspace: run 'make setup'"
MISSING = [
    ("torch", "train --scenes s --train-rooms a:1 --validation-rooms a:2", TRAIN),
    ("torch", "evaluate default --scenes scenes", TRAIN),
    ("torch", "perception --data s", TRAIN),
    ("torch", "data freeze scenes --out o.json", TRAIN),
    ("onnx", "export best.safetensors --perception p --out o", TRAIN),
    ("mujoco", "rooms make --rooms kitchen:1 --out o", "install it with pip install mujoco"),
    ("mujoco", "rooms overhangs --rooms kitchen:1", "install it with pip install mujoco"),
    ("studies", "benchmark I", "it is only in a checkout of cfnav"),
    ("rclpy", "demo", ROS),
    ("rclpy", "simulate", ROS),
    ("rclpy", "robot --robot turtlebot4", ROS),
    ("rclpy", "bag play bag", ROS),
    ("rclpy", "node policy", ROS),
    ("rclpy", "node mock", ROS),
]  # fmt: skip


@pytest.mark.parametrize(("package", "line", "remedy"), MISSING)
def test_what_is_not_installed_is_one_sentence(package, line, remedy, tmp_path: Path):
    """Hidden from every process of the command, as where it is not installed."""
    (tmp_path / "hide").mkdir()
    (tmp_path / "hide/sitecustomize.py").write_text(HIDE)
    hall(name="kitchen:0").save(tmp_path / "scenes/kitchen_00000")
    path = os.pathsep.join([str(tmp_path / "hide"), *sys.path[1:]])
    done = subprocess.run(
        [sys.executable, "-m", "cfnav.cli", *line.split()], cwd=tmp_path, text=True, timeout=120,
        capture_output=True, env={**os.environ, "PYTHONPATH": path, "HIDDEN": package},
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert done.stderr.startswith(f"cfnav: found no {package}, which this needs; {remedy}"), done
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "o").exists()


def test_every_executable_ends_by_the_same_rule():
    """A main of ours gives an exit code, or is a function of its options that ``ending`` calls."""
    for path in [*ROOT.glob("cfnav_*/**/*.py"), *ROOT.glob("sim_bridge/**/*.py")]:
        text = path.read_text()
        assert "def main() -> None" not in text, path
        assert not re.search(r"^    main\(\)$", text, re.MULTILINE), path


def test_options_that_make_no_sense_end_with_two():
    with pytest.raises(SystemExit) as end:
        read_options("cfnav info", import_module("cfnav.policies").Info, ["--unknown"])
    assert end.value.code == 2


def test_info_shows_what_a_bundle_is(cfnav):
    code, out, _ = cfnav("info", "hoz")
    assert code == 0
    assert out == (SHIPPED / "hoz/MODEL_CARD.md").read_text()
    code, out, _ = cfnav("info", "hoz", "--json")
    assert code == 0
    assert json.loads(out)["camera"]["fov_deg"] == [90.0, 90.0]


def test_info_of_a_bundle_without_a_card_says_where_its_figures_stand(cfnav, tmp_path):
    shutil.copytree(SHIPPED / "default", tmp_path / "mine", ignore=lambda *_: ["MODEL_CARD.md"])
    code, out, err = cfnav("info", str(tmp_path / "mine"))
    assert (code, out) == (2, "")
    assert re.fullmatch(r"cfnav: found no MODEL_CARD.md in \S+mine; see .* with --json.*\n", err)
