"""A ROS domain has one graph at a time."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from cfnav_ros.process import domains
from cfnav_ros.process.domains import Domain
from cfnav_ros.process.processes import GraphError

HOLD = """
from cfnav_ros.process.domains import Domain
with Domain({}) as number:
    print(number, flush=True)
    input()
"""


@pytest.fixture
def only(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[range], None]:
    """A function: leaves these domains, locked by nobody."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(domains.tempfile, "tempdir", str(tmp_path))
    return lambda numbers: monkeypatch.setattr(domains, "DOMAINS", numbers)


def test_no_two_draw_the_same_and_a_released_one_is_free(only: Callable) -> None:
    only(range(5, 7))
    with Domain() as one, Domain() as other:
        assert {one, other} == {5, 6}
        with pytest.raises(GraphError, match="have all ROS domains"):
            Domain()
    with Domain() as again:
        assert again in (5, 6)


def test_one_that_is_named_is_kept_from_those_that_draw(only: Callable) -> None:
    only(range(5, 7))
    with Domain(5) as named, Domain(5) as the_same, Domain() as drawn:
        assert (named, the_same, drawn) == (5, 5, 6)


def test_a_process_loses_its_domain_with_its_life(only: Callable) -> None:
    only(range(5, 6))
    child = subprocess.Popen(
        [sys.executable, "-c", HOLD.format(5)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert child.stdout.readline() == b"5\n"
    with pytest.raises(GraphError):
        Domain()
    child.kill()
    child.communicate()
    Domain().release()
