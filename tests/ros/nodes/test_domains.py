"""A ROS domain has one graph at a time."""

from __future__ import annotations

import os
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


FREE = 1000 + 10 * os.getpid()
"""Far above those of ROS, so that no graph of another test has it or the next."""


@pytest.fixture
def only(monkeypatch: pytest.MonkeyPatch) -> Callable[[range], None]:
    """A function: leaves these domains."""
    return lambda numbers: monkeypatch.setattr(domains, "DOMAINS", numbers)


def test_no_two_draw_the_same_and_a_released_one_is_free(only: Callable) -> None:
    only(range(FREE, FREE + 2))
    with Domain() as one, Domain() as other:
        assert {one, other} == {FREE, FREE + 1}
        with pytest.raises(GraphError, match="have all ROS domains"):
            Domain()
    with Domain() as again:
        assert again in (FREE, FREE + 1)


def test_one_that_is_named_is_kept_from_those_that_draw(only: Callable) -> None:
    only(range(FREE, FREE + 2))
    with Domain(FREE) as named, Domain(FREE) as the_same, Domain() as drawn:
        assert (named, the_same, drawn) == (FREE, FREE, FREE + 1)


def test_a_process_with_files_of_its_own_loses_its_domain_with_its_life(
    only: Callable, tmp_path: Path
) -> None:
    only(range(FREE, FREE + 1))
    child = subprocess.Popen(
        [sys.executable, "-c", HOLD.format(FREE)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )  # fmt: skip
    assert child.stdout.readline() == f"{FREE}\n".encode()
    with pytest.raises(GraphError):
        Domain()
    child.kill()
    child.communicate()
    Domain().release()
