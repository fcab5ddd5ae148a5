"""What the machine brings or lacks: system packages, its Python, a sourced ROS."""

from __future__ import annotations

import re
import sys

import pytest


@pytest.fixture
def bare_machine(system, monkeypatch):
    """A machine with Python only: no compiler, no OpenGL."""
    monkeypatch.setattr(system.shutil, "which", {"apt-get": "/usr/bin/apt-get"}.get)
    monkeypatch.setattr(system, "loads", lambda *libraries: False)
    return monkeypatch


def no_run(command, failure):
    raise AssertionError(f"must not run {command}")


def test_without_root_one_line_says_what_to_install(system, steps, bare_machine):
    bare_machine.setattr(system.os, "geteuid", lambda: 1000)
    with pytest.raises(steps.SetupError) as error:
        system.install_missing(no_run, print)
    line = str(error.value)
    assert "\n" not in line
    assert "a C++ compiler" in line
    assert re.search(r"`sudo apt-get install [^`]*g\+\+[^`]*libosmesa6`", line)


def test_without_apt_one_line_names_the_things(system, steps, bare_machine):
    bare_machine.setattr(system.shutil, "which", lambda name: None)
    with pytest.raises(steps.SetupError, match=r"no apt-get here.*Debian they are g\+\+"):
        system.install_missing(no_run, print)


def test_as_root_apt_installs_exactly_what_is_missing(system, steps, bare_machine):
    bare_machine.setattr(system.os, "geteuid", lambda: 0)
    commands = []

    def install(command, failure):
        commands.append(command)
        if "install" in command:
            bare_machine.setattr(system.shutil, "which", lambda name: f"/usr/bin/{name}")
            bare_machine.setattr(system, "loads", lambda *libraries: True)

    system.install_missing(install, print)
    assert [("update" in c, "install" in c) for c in commands] == [(True, False), (False, True)]
    assert {"g++", "libosmesa6"} <= set(commands[1])
    system.install_missing(no_run, print)


def test_nothing_is_installed_when_apt_did_not_help(system, steps, bare_machine):
    bare_machine.setattr(system.os, "geteuid", lambda: 0)
    with pytest.raises(steps.SetupError, match="Missing on this machine: a C"):
        system.install_missing(lambda command, failure: None, print)


def test_set_up_goes_on_without_what_is_not_required(system, steps, bare_machine):
    bare_machine.setattr(system.os, "geteuid", lambda: 0)
    told = []

    def offline(command, failure):
        raise steps.SetupError(failure)

    with pytest.raises(steps.SetupError, match="apt-get update failed"):
        system.install_missing(offline, told.append)
    needs = [need for need in system.needs() if not need.required]
    assert needs
    bare_machine.setattr(system, "needs", lambda: needs)
    system.install_missing(offline, told.append)
    assert told[-1] == "It goes on without them, as they are not required: apt-get update failed"


@pytest.mark.parametrize("version", [(3, 10), (3, 13)])
def test_another_python_is_refused(system, steps, version):
    with pytest.raises(steps.SetupError, match=f"Found Python 3.{version[1]}; cfnav needs 3.11"):
        system.check_python(version)


def test_a_sourced_jazzy_is_used_and_another_ros_refused(system, steps, tmp_path):
    venv, ros = tmp_path / ".venv", tmp_path / "ros"
    record = venv / "cfnav/ros"
    package = ros / "share/rclpy/package.xml"
    package.parent.mkdir(parents=True)
    package.write_text("<package/>")
    sourced = {"AMENT_PREFIX_PATH": f"/nowhere:{ros}", "ROS_DISTRO": "jazzy"}
    assert system.find_ros(sourced, record) == ros
    assert system.find_ros({}, record) == venv
    with pytest.raises(steps.SetupError, match="Found ROS 'humble' sourced"):
        system.find_ros({**sourced, "ROS_DISTRO": "humble"}, record)
    record.parent.mkdir(parents=True)
    record.write_text(f"{ros}\n")
    assert system.find_ros({}, record) == venv  # it has gone since
    (ros / "setup.bash").touch()
    assert system.find_ros({}, record) == ros
    record.unlink()
    (ros / "pyvenv.cfg").touch()  # a virtual environment with the wheels
    assert system.find_ros(sourced, record) == venv


CONFIGURATION = """\
:env:.find-links='/wheels /more'
global.cert='/ca.crt'
global.extra-index-url='file:///a\\nfile:///b'
global.find-links='/elsewhere'
global.timeout='9'
install.constraint='/bounds.txt'
"""


def test_uv_is_told_what_pip_is_configured_to(commands):
    assert commands.as_uv(commands.pip_settings(CONFIGURATION)) == {
        "UV_INDEX_STRATEGY": "unsafe-best-match",
        "UV_FIND_LINKS": "/wheels,/more",
        "UV_INDEX": "file:///a file:///b",
        "UV_CONSTRAINT": "/bounds.txt",
        "SSL_CERT_FILE": "/ca.crt",
    }


@pytest.mark.parametrize("no_index", ["true", "no"])
def test_uv_looks_into_no_index_when_pip_may_not(commands, monkeypatch, no_index):
    monkeypatch.setattr(commands, "PYTHON", sys.executable)
    monkeypatch.setenv("PIP_NO_INDEX", no_index)
    monkeypatch.setenv("PIP_INDEX_URL", "https://user:secret@index/simple")
    ran = []
    monkeypatch.setattr(commands, "run", lambda command, failure, more: ran.append((command, more)))
    commands.install("numpy")
    ((command, more),) = ran
    assert command[-1] == "numpy"
    assert ("--no-index" in command) == (no_index == "true")
    assert "secret" not in str(command)
    assert more["UV_DEFAULT_INDEX"] == "https://user:secret@index/simple"


def test_commands_see_nothing_of_another_environment(commands, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", "/elsewhere")
    monkeypatch.setenv("AMENT_PREFIX_PATH", "/elsewhere")
    monkeypatch.setenv("PATH", "/bin")
    found = commands.variables()
    assert "/elsewhere" not in found.values()
    assert found["PATH"] == f"{commands.VENV}/bin:/bin"
