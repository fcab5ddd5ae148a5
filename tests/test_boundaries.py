"""The import rules of the house, which ``studies.house`` reads from each folder's ``__init__``."""

from __future__ import annotations

import re
import subprocess
import sys
from graphlib import TopologicalSorter

import pytest

from studies.house import FOLDERS, HEAVY, MODULES, ROOT, covers, forbidden_imports, rule, speaks_ros

MOST_FILES = 23
OURS = "cfnav|cfnav_core|cfnav_ros|sim_bridge|studies"
STARTED = re.compile(rf"""-m"?,? "?((?:{OURS})\.[a-z0-9_.]*[a-z0-9_])""")

# A robot needs none of these: only what trains or exports may load torch.
TORCH_FREE = (
    "cfnav_core.policy.policy", "cfnav_core.policy.bundle", "cfnav_core.perception.perception",
    "cfnav_core.task.metrics", "cfnav.cli", "sim_bridge.world.world", "studies.bench.policy",
)  # fmt: skip

LOAD = """
import importlib, sys
forbidden, names = set(sys.argv[1].split(",")), sys.argv[2:]
for name in names:
    importlib.import_module(name)
    found = forbidden & {loaded.split(".")[0] for loaded in sys.modules}
    if found:
        sys.exit(f"importing {name} loads {sorted(found)}")
print(len(names))
"""


def test_every_folder_has_a_rule():
    without = [name for name in FOLDERS if rule(name) is None]
    assert without == ["cfnav_core", "cfnav_ros", "sim_bridge"]  # they hold folders only
    known = HEAVY | set(FOLDERS)
    assert {n for name in FOLDERS for n in rule(name) or () if n not in known} == set()


@pytest.mark.parametrize("name", MODULES)
def test_a_module_imports_what_its_folder_may(name):
    assert list(forbidden_imports(name)) == []


def test_the_rules_have_no_circle():
    """Of a folder and the folders below it only one is named: they are one house."""
    uses = {
        name: {a for a in rule(name) or () if a in FOLDERS and not covers(a, name)}
        for name in FOLDERS
        if "." in name
    }
    list(TopologicalSorter(uses).static_order())


def test_no_folder_is_too_full():
    count = {
        f: sum(p.parent == path.parent for p in MODULES.values()) for f, path in FOLDERS.items()
    }
    assert {folder: n for folder, n in count.items() if n > MOST_FILES} == {}


def load(forbidden: set[str], *names: str) -> subprocess.CompletedProcess[str]:
    """Imports the modules one after the other in a fresh process."""
    command = [sys.executable, "-c", LOAD, ",".join(sorted(forbidden)), *names]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize(
    ("package", "forbidden"),
    [
        ("cfnav_core", {"rclpy", "mujoco", "cfnav_ros", "sim_bridge"}),
        ("cfnav_ros", {"rclpy", "mujoco", "torch", "sim_bridge"}),
        ("sim_bridge", {"rclpy", "torch", "cfnav_ros"}),
    ],
)
def test_importing_what_is_pure_loads_no_ros(package, forbidden):
    names = [n for n in MODULES if covers(package, n) and not speaks_ros(n)]
    done = load(forbidden, *names)
    assert (done.returncode, done.stderr) == (0, "")
    assert int(done.stdout) == len(names)


def test_the_check_finds_what_it_looks_for():
    done = load({"numpy"}, "cfnav_core.task.actions", "cfnav_core.perception.perception")
    assert done.returncode == 1
    assert "loads ['numpy']" in done.stderr


def test_a_robot_loads_no_torch():
    done = load({"torch"}, *TORCH_FREE)
    assert (done.returncode, done.stderr) == (0, "")


def test_what_is_started_as_a_program_is_one():
    """A module without an end ``if __name__ == "__main__"`` does nothing, and calls it success."""
    pages = [*MODULES.values(), ROOT / "Makefile", *ROOT.glob("*.md"), *ROOT.glob("docs/*.md")]
    named = {name: page for page in pages for name in STARTED.findall(page.read_text())}
    assert len(named) > 20
    idle = {
        f"{page.relative_to(ROOT)}: {name}" for name, page in named.items()
        if name not in MODULES or "__main__" not in MODULES[name].read_text()
    }  # fmt: skip
    assert idle == set()
