"""``scripts/env.sh`` in a shell where another ROS was sourced before."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.conftest import ROOT

LISTS = (
    "PATH", "PYTHONPATH", "LD_LIBRARY_PATH", "CMAKE_PREFIX_PATH", "COLCON_PREFIX_PATH",
    "AMENT_PREFIX_PATH",
)  # fmt: skip


def sourced(root: Path, variables: dict[str, str]) -> dict[str, list[str]]:
    """The lists that a shell with these variables has after ``source scripts/env.sh``."""
    show = "; ".join(f'printf "%s\\n" "${{{name}:-}}"' for name in LISTS)
    script = f"set -e; source scripts/env.sh; {show}"
    text = subprocess.check_output(
        ["bash", "-c", script], cwd=root, text=True, env={"PATH": "/usr/bin:/bin", **variables}
    )
    return dict(zip(LISTS, (line.split(":") for line in text.splitlines()), strict=True))


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout that is set up: Python 3.12, a ROS and a workspace with one path each."""
    root = tmp_path / "cfnav"
    for folder in ("scripts", ".venv/bin", ".venv/lib/python3.12", "ros_ws/install"):
        (root / folder).mkdir(parents=True)
    shutil.copy(ROOT / "scripts/env.sh", root / "scripts")
    (root / ".venv/bin/python").touch(0o755)
    (root / "ros_ws/install/cfnav.stamp").write_text("0" * 64)
    (root / "ros_ws/install/setup.bash").write_text(
        'export PYTHONPATH="/ours/lib/python3.12/site-packages:${PYTHONPATH:-}"\n'
    )
    return root


@pytest.fixture
def humble(tmp_path: Path) -> dict[str, str]:
    """What a sourced Humble leaves in a shell, beside a user's own entries."""
    prefix, overlay = tmp_path / "humble", tmp_path / "ws/install/mine"
    (prefix / "elsewhere/rclpy").mkdir(parents=True)
    return {
        "ROS_DISTRO": "humble",
        "AMENT_PREFIX_PATH": f"{overlay}:{prefix}:/usr",
        "COLCON_PREFIX_PATH": str(overlay.parent),
        "CMAKE_PREFIX_PATH": f"{prefix}:/my/cmake",
        "LD_LIBRARY_PATH": f"{overlay}/lib:{prefix}/lib:/my/lib",
        "PATH": f"{prefix}/bin:/usr/bin:/bin",
        "PYTHONPATH": f"{overlay}/lib/python3.10/site-packages:/my/modules"
        f":{prefix}/elsewhere:/else/lib/python3.10/site-packages",
    }


@pytest.mark.parametrize("wheels", [True, False], ids=["wheels", "apt"])
def test_nothing_of_another_ros_is_left(checkout: Path, humble: dict, wheels: bool) -> None:
    if wheels:
        (checkout / ".venv/setup.bash").touch()
    found = sourced(checkout, humble)
    assert found["PATH"] == [f"{checkout}/.venv/bin", "/usr/bin", "/bin"]
    assert found["LD_LIBRARY_PATH"] == ["/my/lib"]
    assert found["CMAKE_PREFIX_PATH"] == ["/my/cmake"]
    assert found["COLCON_PREFIX_PATH"] == [""]
    assert found["AMENT_PREFIX_PATH"] == ["/usr"]
    own = [str(checkout), f"{checkout}/sim_bridge", f"{checkout}/cfnav_ros"]
    ours = [*own, "/ours/lib/python3.12/site-packages", "/my/modules"]
    assert found["PYTHONPATH"] == ours


def test_an_rclpy_in_pythonpath_alone_is_taken_out(checkout: Path, humble: dict) -> None:
    found = sourced(checkout, {"PYTHONPATH": humble["PYTHONPATH"]})
    assert found["PYTHONPATH"][3:] == ["/ours/lib/python3.12/site-packages", "/my/modules"]


def test_a_workspace_over_jazzy_from_apt_stays(checkout: Path) -> None:
    over = {
        "ROS_DISTRO": "jazzy",
        "AMENT_PREFIX_PATH": "/my/ws/install/msgs:/opt/ros/jazzy",
        "PYTHONPATH": "/my/ws/install/msgs/lib/python3.12/site-packages",
    }
    found = sourced(checkout, over)
    assert found["AMENT_PREFIX_PATH"] == ["/my/ws/install/msgs", "/opt/ros/jazzy"]
    assert found["PYTHONPATH"][-1] == over["PYTHONPATH"]


@pytest.mark.ros
def test_our_rclpy_is_imported_though_another_is_in_front(tmp_path: Path) -> None:
    for place in ("lib/python3.10/site-packages", "plain"):
        other = tmp_path / place / "rclpy"
        other.mkdir(parents=True)
        (other / "__init__.py").write_text("raise ImportError('rclpy of Humble')\n")
        variables = {**os.environ, "PYTHONPATH": str(other.parent)}
        script = "source scripts/env.sh && source scripts/env.sh && python -c 'import rclpy'"
        subprocess.run(["bash", "-c", script], cwd=ROOT, env=variables, check=True)
