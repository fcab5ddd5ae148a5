"""What the machine brings or lacks: system packages, its Python, a sourced ROS."""

from __future__ import annotations

import re

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


def test_a_sourced_jazzy_is_used_and_another_ros_refused(environment, steps, tmp_path, monkeypatch):
    monkeypatch.setattr(environment, "ROS_FILE", tmp_path / "none")
    package = tmp_path / "ros/share/rclpy/package.xml"
    package.parent.mkdir(parents=True)
    package.write_text("<package/>")
    sourced = {"AMENT_PREFIX_PATH": f"/nowhere:{tmp_path / 'ros'}", "ROS_DISTRO": "jazzy"}
    assert environment.find_ros(sourced) == str(tmp_path / "ros")
    assert environment.find_ros({}) == environment.WHEELS
    with pytest.raises(steps.SetupError, match="Found ROS 'humble' sourced"):
        environment.find_ros({**sourced, "ROS_DISTRO": "humble"})
    (tmp_path / "ros/pyvenv.cfg").write_text("")  # a virtual environment with the wheels
    assert environment.find_ros(sourced) == environment.WHEELS
