"""One run of one cell of the fault matrix: a goal, a fault in the right moment, what came of it."""

from __future__ import annotations

import math
import signal
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from cfnav_ros.process.processes import GraphError

from cfnav_core.task.actions import Action
from studies.deploy.expectations import PROCESS_FAULTS
from studies.deploy.judge import ObservedRun, judge, rode
from studies.deploy.places import ROOM, StartPlaces
from studies.deploy.reactions import Expectation, FaultPhase, Reaction
from studies.deploy.rig import PassingClient, Rig

LISTS = {
    "Laptop": (Action.MoveAhead,),
    "Mug": (Action.RotateLeft, Action.MoveAhead),
    "Bowl": (Action.LookDown, Action.LookUp, Action.LookDown, Action.MoveAhead),
}
"""What the measuring bundle answers for each goal; the last action again and again."""

GOALS = {FaultPhase.DRIVING: "Laptop", FaultPhase.TURNING: "Mug", FaultPhase.WAITING: "Bowl"}
UNKNOWN_GOAL = "Nothing"
"""No category: the newer goal that is refused after it has ended the older one."""

WHEN_V, WHEN_W = 0.1, 0.3
"""m/s and rad/s that the simulator calls driving and turning, for faults that it does not play."""

BEGIN_S = 20.0
"""Real seconds within which the robot does what the fault waits for."""

STOOD_S = 1.0
"""How long a fault has stood when a goal comes that it should refuse, s."""

WATCH_S = 12.0
"""How long a robot is watched after a fault, s: blindness ends the episode after 5 s, and what does
not come to rest after as many and 2 s of stopping."""

LONG_WATCH_S = 15.0
"""How long one that should ride through, or refuse, may take to show it, s: longer than the
preflight waits for inputs that may yet come."""

AFTER_S = 0.5
"""How long it is watched after the goal has ended or the fault was ridden through, s."""


@dataclass(frozen=True)
class RunRecord:
    """One run, as it is written down. Times are seconds; ``terms`` are what it was judged by."""

    fault: str
    phase: str
    run: int
    place: str
    terms: dict[str, Any]
    reaction: str
    stop_s: float | None
    end_s: float | None
    """From the fault to the goal's end; None while it lasts."""
    last_motion: str
    as_expected: bool
    contacts: int
    outcome: str
    message: str
    vetoes: int


class CellRun:
    """Runs one cell once; ``broken`` says that the graph must be replaced."""

    def __init__(self, rig: Rig, cell: Expectation) -> None:
        """Only remember what to do; ``run`` does it."""
        self.rig, self.cell = rig, cell
        self.goal = GOALS[cell.phase]
        self.fault_s = math.inf
        self.broken = False
        self._ended_s = math.inf
        self._handle: Any = None
        self._result: Any = None
        self._client: PassingClient | None = None

    def run(self, places: StartPlaces, number: int) -> RunRecord:
        """Prepare, break, watch and judge.

        Raises:
            GraphError: the graph did not get as far as the fault.
        """
        rig, cell = self.rig, self.cell
        before_wall = cell.before_wall and number % 2 == 1
        start = places.before_wall(number) if before_wall else places.open.start(number)
        rig.prepare(ROOM, start, number)
        if cell.fault in PROCESS_FAULTS:
            self._break_process()
        elif cell.reaction is Reaction.REFUSE:
            rig.fault(cell.fault)
            self._wait_until_begun()
            rig.watch(lambda: rig.now > self.fault_s + STOOD_S, BEGIN_S)
            self._send()
        elif cell.phase is FaultPhase.WAITING:
            self._send()
            self._wait(lambda: rig.decisions, "a decision")
            rig.fault(cell.fault)
            self._wait_until_begun()
        else:
            rig.fault(cell.fault, when=cell.phase.value)
            self._send()
            self._wait_until_begun()
        self._watch()
        self._mend_process()
        seen = self._seen()
        judged = judge(seen, cell)
        return RunRecord(
            fault=cell.fault,
            phase=cell.phase.value,
            run=number,
            place="wall" if before_wall else "open",
            terms=cell.terms,
            reaction=judged.reaction.value,
            stop_s=judged.stop_s,
            end_s=round(seen.ended_s - seen.fault_s, 3) if seen.outcome else None,
            last_motion=judged.last_motion.value,
            as_expected=judged.as_expected,
            contacts=judged.contacts,
            outcome=seen.outcome,
            message=seen.message,
            vetoes=seen.vetoes,
        )

    def _send(self) -> None:
        if self.cell.fault == "client_gone":
            self._client = PassingClient(self.rig, self.goal)
            return
        self._handle = self.rig.graph.send_goal(self.goal)
        if not self._handle.accepted:
            raise GraphError("policy_node did not accept a goal")
        self._result = self._handle.get_result_async()

    def _wait(self, condition: Callable[[], object], what: str) -> None:
        if not self.rig.watch(condition, BEGIN_S):
            text = f"{self.cell.fault}, {self.cell.phase.value}: {what} did not come"
            if self._result is not None and self._result.done():
                text += f"; the goal ended: {self._result.result().result.message}"
            raise GraphError(text)

    def _wait_until_begun(self) -> None:
        name = self.cell.fault
        self._wait(lambda: self.rig.announced(name) < math.inf, "the fault")
        self.fault_s = self.rig.announced(name)

    def _break_process(self) -> None:
        rig, fault = self.rig, self.cell.fault
        self._send()
        moment = {
            FaultPhase.DRIVING: lambda: abs(rig.truth[-1].v) > WHEN_V,
            FaultPhase.TURNING: lambda: abs(rig.truth[-1].w) > WHEN_W,
            FaultPhase.WAITING: lambda: rig.decisions,
        }
        self._wait(moment[self.cell.phase], "the moment for the fault")
        self.fault_s = rig.now
        signals = {
            "sigkill": signal.SIGKILL, "sigint": signal.SIGINT, "sigterm": signal.SIGTERM,
            "hang": signal.SIGSTOP,
        }  # fmt: skip
        who, _, what = fault.partition("_")
        if what in signals:
            name = {"policy": "policy_node", "lidar": "lidar_collision_node"}[who]
            rig.signal(name, signals[what])
            self.broken = what != "hang"
        elif fault == "goal_cancel":
            self._handle.cancel_goal_async()
        elif fault == "goal_newer":
            rig.graph.send_goal(UNKNOWN_GOAL)
        else:
            assert self._client is not None
            self._client.vanish()

    def _mend_process(self) -> None:
        if self.cell.fault.endswith("_hang"):
            name = "policy_node" if self.cell.fault.startswith("policy") else "lidar_collision_node"
            self.rig.signal(name, signal.SIGCONT)

    def _watch(self) -> None:
        rig, bound = self.rig, self.cell.bound_s or 0.0
        stays = self.cell.reaction in (Reaction.STOP, Reaction.DEGRADE)
        patience = max(WATCH_S if stays else LONG_WATCH_S, bound + AFTER_S)

        def over() -> bool:
            # The newest sample, not the time since: what nobody told of cannot be judged.
            now = rig.truth[-1].t
            t = now - self.fault_s
            if self._result is not None and self._result.done():
                self._ended_s = min(self._ended_s, now)
                return now > max(self._ended_s, self.fault_s + bound) + AFTER_S
            silenced = self.cell.fault.startswith("policy_") and t > bound + 3 * AFTER_S
            ridden = t > bound + AFTER_S and rode(self._seen())
            return silenced or ridden or t > patience

        if not rig.watch(over, 3 * LONG_WATCH_S):
            raise GraphError("the simulator's account of the robot stopped")

    def _seen(self) -> ObservedRun:
        done = self._result is not None and self._result.done()
        result = self._result.result().result if done else None
        return ObservedRun(
            truth=self.rig.truth,
            fault_s=self.fault_s,
            mended_s=self.rig.announced(self.cell.fault, active=False),
            outcome=result.outcome if result else "",
            message=result.message if result else "",
            vetoes=sum(decision.vetoed for decision in self.rig.decisions),
            ended_s=self._ended_s,
        )
