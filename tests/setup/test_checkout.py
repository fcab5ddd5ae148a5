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
    for name in ("Makefile", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path)
    return tmp_path


def test_a_shell_in_a_fresh_clone_is_told_to_set_up(checkout):
    done = subprocess.run(
        ["bash", "-c", "source scripts/env.sh; echo code $?"],
        cwd=checkout, capture_output=True, text=True,
    )  # fmt: skip
    assert done.stdout == "code 1\n"
    assert f"cfnav is not set up in {checkout}: run 'make setup' there first." in done.stderr


@pytest.fixture
def offline(checkout):
    """Runs `make setup` where pip finds no package."""
    variables = {**os.environ, "PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(checkout)}
    variables = {k: v for k, v in variables.items() if k not in ("AMENT_PREFIX_PATH", "ROS_DISTRO")}
    return lambda: subprocess.run(
        ["make", "setup", f"PYTHON={sys.executable}"],
        cwd=checkout, env=variables, capture_output=True, text=True, timeout=300,
    )  # fmt: skip


def test_a_failing_command_shows_its_output_and_one_sentence(checkout, offline):
    done = offline()
    assert done.returncode != 0
    assert "Traceback" not in done.stderr
    assert "No matching distribution found" in done.stderr
    assert "Set-up failed: pip could not install uv (all of its output:" in done.stderr
    assert not (checkout / ".venv/cfnav/venv.stamp").exists()


def test_after_an_interruption_nothing_half_done_is_left(checkout, offline, steps):
    half = checkout / ".venv/lib/half-installed"
    built = checkout / "ros_ws/build/half-built"
    stamp = checkout / ".venv/cfnav/test.stamp"
    for path in (half, built, stamp):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(steps.BEGUN)
    assert "An earlier run was interrupted during: Packages for tests" in offline().stdout
    assert not half.exists()
    assert not built.exists()
    assert not stamp.exists()


def test_an_environment_that_others_link_to_is_not_emptied(checkout, offline, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("venv")
    (elsewhere / "kept").touch()
    (checkout / ".venv").symlink_to(elsewhere)
    assert "Set-up failed: Cannot call rmtree on a symbolic link" in offline().stderr
    assert (elsewhere / "kept").exists()


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
        _, errors = process.communicate(timeout=300)
    finally:
        process.kill()
    assert process.returncode == 130
    wait_until(lambda: not running(checkout), "nothing goes on alone")
    assert errors == "Set-up interrupted; the next run starts afresh.\n"
