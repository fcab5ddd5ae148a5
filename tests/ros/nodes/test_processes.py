"""Child processes are started, watched and ended."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import pytest
from cfnav_ros.process.domains import stay_apart
from cfnav_ros.process.processes import Child, GraphError, keep_local, node_command

from tests.conftest import wait_until


def start(tmp_path: Path, code: str) -> Child:
    command = [sys.executable, "-u", "-c", code]
    return Child("child", command, tmp_path / "child.log", os.environ)


def test_a_child_that_ended_is_named_with_its_last_words_and_its_log(tmp_path: Path) -> None:
    child = start(tmp_path, "print('no such room'); raise SystemExit(2)")
    wait_until(child.ended, "its end")
    assert child.ended() == f"child ended with code 2: no such room (log: {tmp_path}/child.log)"
    assert child.stop() == 2


def test_a_child_that_ignores_interrupts_is_still_ended(tmp_path: Path) -> None:
    child = start(
        tmp_path,
        "import signal,time\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\nprint('up')\n"
        "time.sleep(600)",
    )
    wait_until(lambda: "up" in child.log.read_text(), "its first word")
    assert child.ended() is None
    assert child.stop(patience_s=2.0) == -signal.SIGTERM


def test_children_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    parent = start(
        tmp_path,
        "import os,sys,time;from pathlib import Path\n"
        "from cfnav_ros.process.processes import Child\n"
        f"child = Child('inner', [sys.executable, '-c', 'import time; time.sleep(600)'], "
        f"Path({str(tmp_path / 'inner.log')!r}), os.environ)\n"
        "print(child.pid, 'is up'); time.sleep(600)",
    )
    wait_until(lambda: "is up" in parent.log.read_text(), "the child")
    inner = int(parent.log.read_text().split()[0])
    os.kill(parent.pid, signal.SIGKILL)
    parent.stop()
    wait_until(lambda: not _runs(inner), "the end of the child")


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except FileNotFoundError:
        return False


def test_installed_executables_come_before_modules(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    assert node_command("cfnav_ros", "policy_node")[1:] == ["-m", "cfnav_ros.ros.policy_node"]
    program = tmp_path / "lib" / "cfnav_ros" / "policy_node"
    program.parent.mkdir(parents=True)
    program.touch(0o755)
    assert node_command("cfnav_ros", "policy_node") == [str(program)]


def test_a_local_graph_forgets_what_leads_beyond_this_machine(tmp_path: Path) -> None:
    environment = {"ROS_STATIC_PEERS": "10.0.0.2", "ROS_LOG_DIR": "/logs", "ROS_DOMAIN_ID": "7"}
    keep_local(environment)
    profile = Path(environment.pop("FASTRTPS_DEFAULT_PROFILES_FILE"))
    assert profile.is_file()
    kept = {"ROS_LOG_DIR": "/logs", "ROS_DOMAIN_ID": "7"}
    assert environment == {**kept, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    keep_local(environment, tmp_path)
    assert environment["ROS_LOG_DIR"] == f"{tmp_path}/ros"


@pytest.mark.parametrize("shell", ["7", "007"])
@pytest.mark.parametrize("domain", ["7", "elsewhere", "102", "-1", "", "²"])
def test_a_replay_stays_out_of_the_domain_of_the_shell(shell: str, domain: str) -> None:
    environment = {"ROS_DOMAIN_ID": shell}
    with pytest.raises(GraphError, match="expected 0 to 101 but not"):
        stay_apart(environment, domain)
    assert environment == {"ROS_DOMAIN_ID": shell}


@pytest.mark.parametrize("shell", [{}, {"ROS_DOMAIN_ID": ""}, {"ROS_DOMAIN_ID": "0"}])
def test_a_shell_without_a_domain_is_in_the_first(shell: dict[str, str]) -> None:
    with pytest.raises(GraphError, match="but not 0, the domain of this shell"):
        stay_apart({**shell}, "0")
    environment = {**shell, "ROS_STATIC_PEERS": "10.0.0.2"}
    assert stay_apart(environment, "99") == 99
    assert environment["ROS_DOMAIN_ID"] == "99"
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert "ROS_STATIC_PEERS" not in environment
