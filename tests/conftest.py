"""Fixtures for tests that run real processes on a ROS graph of their own.

A skipped test marked `ros` counts as failed when CFNAV_REQUIRE_ROS is set: `make test` sets it.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator
from pathlib import Path

import pytest
from cfnav_ros.process.domains import Domain
from cfnav_ros.process.processes import keep_local

# Started in the background of a shell, pytest and all it starts would ignore SIGINT.
signal.signal(signal.SIGINT, signal.default_int_handler)
# No test is seen by a robot on the network, whatever the shell has set: a discovery server would
# join all domains.
keep_local(os.environ)

ROOT = Path(__file__).resolve().parent.parent
DEADLINE_S = 120.0
"""Of every wait, which ends as soon as what it waits for is there: long, for busy machines."""
STARTED = pytest.StashKey[list["RunningProcess"]]()
"""The processes of a test: a failure shows what each has said."""


def _fail_instead_of_skip(report: pytest.TestReport | pytest.CollectReport) -> None:
    if not report.skipped or hasattr(report, "wasxfail"):
        return
    reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    report.outcome = "failed"
    report.longrepr = f"A ROS test may not be skipped here ({reason}). Run it through `make test`."


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Shows what was said by what failed; turns a skip into a failure where ROS is required."""
    report = yield
    error = call.excinfo and call.excinfo.value
    if isinstance(error, subprocess.CalledProcessError):
        report.sections.append(("stderr of the command", str(error.stderr)))
    if report.failed:
        for process in item.stash.get(STARTED, []):
            report.sections.append((f"output of {process.process.args[:4]}", process.output))
    if os.environ.get("CFNAV_REQUIRE_ROS") and item.get_closest_marker("ros"):
        _fail_instead_of_skip(report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """The same for a whole module that skips itself, as with `importorskip("rclpy")`."""
    report = yield
    if os.environ.get("CFNAV_REQUIRE_ROS") and collector.path.is_relative_to(ROOT / "tests/ros"):
        _fail_instead_of_skip(report)
    return report


def wait_until(
    condition: Callable[[], object],
    what: str | Callable[[], str],
    between: Callable[[], object] = lambda: time.sleep(0.02),
) -> None:
    """Waits for a condition; the test fails when it does not hold within ``DEADLINE_S``.

    Args:
        condition: Called until it is true.
        what: The condition in words, for the failure; called then when it can be.
        between: Called after each look that found it false; takes a little time.
    """
    end = time.monotonic() + DEADLINE_S
    while not condition():
        if time.monotonic() > end:
            words = what if isinstance(what, str) else what()
            pytest.fail(f"{words}: not within {DEADLINE_S:.0f} s")
        between()


class RunningProcess:
    """A child process and everything it has written, stdout and stderr together."""

    def __init__(self, command: list[str], log: Path, environment: dict[str, str]) -> None:
        self._log = log
        with log.open("wb") as output:
            self.process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=output, stderr=output, env=environment
            )

    @property
    def output(self) -> str:
        """What it has written so far."""
        return self._log.read_text(errors="replace")

    def wait_for_line(self, pattern: str) -> re.Match[str]:
        """Waits until a line of the output matches; fails when the process ends before."""
        found: list[re.Match[str]] = []

        def seen() -> bool:
            ended = self.process.poll() is not None
            match = re.search(pattern, self.output, re.MULTILINE)
            if match is None and ended:
                pytest.fail(
                    f"ended with {self.process.returncode} before '{pattern}':\n{self.output}"
                )
            found.extend([match] if match else [])
            return bool(found)

        wait_until(seen, f"a line '{pattern}'")
        return found[0]

    def wait(self, timeout_s: float = DEADLINE_S) -> int:
        """Waits for the end and returns the exit code."""
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            pytest.fail(f"still running after {timeout_s:.0f} s:\n{self.output}")

    def interrupt(self) -> int:
        """Sends SIGINT, as Ctrl-C does, and returns the exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.wait()

    def end(self) -> None:
        """Ends it however it takes."""
        for sign in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            if self.process.poll() is None:
                self.process.send_signal(sign)
            try:
                self.process.wait(20)
                return
            except subprocess.TimeoutExpired:
                continue


LATELY: deque[Domain] = deque()
REMEMBERED = 10
"""A node that was killed is still seen in its domain for seconds: the last domains are kept from
the next tests, of which ten take longer."""


@pytest.fixture
def ros_domain_id(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A ROS domain that nobody else on this machine has now, set in the environment."""
    domain = Domain()
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain.number))
    yield domain.number
    LATELY.append(domain)
    if len(LATELY) > REMEMBERED:
        LATELY.popleft().release()


@pytest.fixture
def start_process(
    ros_domain_id: int, tmp_path: Path, request: pytest.FixtureRequest
) -> Iterator[Callable[..., RunningProcess]]:
    """A function that starts a module ("cfnav_ros.ros.policy_node") or an executable (a Path).

    Everything it started is ended after the test.
    """
    started = request.node.stash.setdefault(STARTED, [])

    def start(target: str | Path, *arguments: str, **variables: str) -> RunningProcess:
        program = [str(target)] if isinstance(target, Path) else [sys.executable, "-m", target]
        environment = {**os.environ, "ROS_DOMAIN_ID": str(ros_domain_id), **variables}
        process = RunningProcess(
            [*program, *arguments], tmp_path / f"process{len(started)}.log", environment
        )
        started.append(process)
        return process

    yield start
    for process in reversed(started):
        process.end()
