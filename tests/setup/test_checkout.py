"""The set-up run in a fresh clone: not yet there, failing, ended half-way."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT, wait_until


@pytest.fixture
def checkout(tmp_path):
    """A copy of the set-up files, as after a clone."""
    for name in ("scripts", "requirements"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "Makefile", tmp_path)
    return tmp_path


def test_a_shell_in_a_fresh_clone_is_told_to_set_up(checkout):
    done = subprocess.run(
        ["bash", "-c", "source scripts/env.sh; echo code $?"],
        cwd=checkout, capture_output=True, text=True,
    )  # fmt: skip
    assert done.stdout == "code 1\n"
    assert f"cfnav is not set up in {checkout}: run 'make setup' there first." in done.stderr


def test_a_failing_command_shows_its_output_and_one_sentence(checkout):
    variables = {**os.environ, "PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(checkout)}
    variables = {k: v for k, v in variables.items() if k not in ("AMENT_PREFIX_PATH", "ROS_DISTRO")}
    done = subprocess.run(
        ["make", "setup", f"PYTHON={sys.executable}"],
        cwd=checkout, env=variables, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode != 0
    assert "Traceback" not in done.stderr
    assert "No matching distribution found" in done.stderr
    assert "Set-up failed: pip could not install the packages (all of its output:" in done.stderr
    assert not (checkout / ".venv/cfnav/packages.stamp").exists()
    assert (checkout / ".venv/cfnav/venv.stamp").exists()


def running(folder):
    """Ids of processes that name the folder on their command line."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = path.read_bytes()
        except OSError:  # it has just ended
            continue
        found += [path.parent.name] if str(folder).encode() in words else []
    return found


def test_an_ended_set_up_says_so_and_is_taken_up_afresh(checkout):
    variables = {
        k: v for k, v in os.environ.items() if k not in ("AMENT_PREFIX_PATH", "ROS_DISTRO")
    }
    process = subprocess.Popen(
        [sys.executable, "scripts/set_up.py"],
        cwd=checkout, env=variables, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert "Virtual environment .venv" in process.stdout.readline()
        wait_until((checkout / ".venv/bin").exists, "the virtual environment has begun")
        wait_until(lambda: running(checkout), "a command runs")
        process.terminate()
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130
    wait_until(lambda: not running(checkout), "nothing goes on alone")
    assert errors == "Set-up interrupted; the next run starts the interrupted step afresh.\n"
    assert (checkout / ".venv/cfnav/in-progress").read_text() == "venv\n"
    assert not (checkout / ".venv/cfnav/venv.stamp").exists()
