"""Runs of the fault matrix -> one line a cell, a Markdown table, a picture. Knows no ROS."""

from __future__ import annotations

import statistics
from collections import Counter, defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from studies.deploy import judge
from studies.deploy.expectations import EXPECTATIONS
from studies.deploy.reactions import FaultPhase

COLOURS = {True: "#2a9d8f", False: "#e76f51"}
"""As expected or not; told apart in grey too."""


def summarise(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """One dictionary for each cell that was measured, in the order of the expectations.

    Times are of the runs in which something was stopped; None where that was none.
    """
    runs = defaultdict(list)
    for row in rows:
        runs[row["fault"], row["phase"]].append(row)
    cells = []
    for expected in EXPECTATIONS:
        made = runs.get((expected.fault, expected.phase.value))
        if not made:
            continue
        stops = [row["stop_s"] for row in made if row["stop_s"] is not None]
        ends = [row["end_s"] for row in made if row["end_s"] is not None]
        reactions = Counter(row["reaction"] for row in made)
        cells.append({
            "fault": expected.fault,
            "phase": expected.phase.value,
            "reaction": reactions.most_common(1)[0][0],
            "reactions": dict(reactions.most_common()),
            "expected": expected.reaction.value,
            "reason": expected.reason,
            "runs": len(made),
            "stops": len(stops),
            "stop_s_min": min(stops, default=None),
            "stop_s_median": statistics.median(stops) if stops else None,
            "stop_s_max": max(stops, default=None),
            "last_motions": dict(Counter(row["last_motion"] for row in made)),
            "bound_s": None if expected.bound_s is None else round(expected.bound_s, 3),
            "end_s_max": max(ends, default=None),
            "end_bound_s": None if expected.end_s is None else round(expected.end_s, 3),
            "as_expected": all(row["as_expected"] for row in made),
            "runs_as_expected": sum(row["as_expected"] for row in made),
            "contacts": sum(row["contacts"] for row in made),
            "before_wall": sum(row["place"] == "wall" for row in made),
            "attempts": sum(row["attempts"] for row in made),
            "changed": expected.changed,
            "commits": sorted({row["commit"] for row in made}),
            "message": next((row["message"] for row in made if row["message"]), ""),
        })  # fmt: skip
    return cells


def table(cells: Sequence[dict[str, Any]]) -> str:
    """The cells as Markdown, a row for each fault; what was measured first told in a sentence.

    A cell says the reaction, the median and longest time to rest and its bound in seconds, or that
    the motion finished and none followed; where the episode's end is bounded, the longest time to
    it as well. Where runs differed it counts the reactions; one that was not as expected in every
    run also says in how many it was, and what was expected.
    """
    met = sum(cell["as_expected"] for cell in cells)
    phases = [phase.value for phase in FaultPhase]
    by_fault: dict[str, dict[str, str]] = defaultdict(dict)
    for cell in cells:
        by_fault[cell["fault"]][cell["phase"]] = _in_words(cell)
    reasons = {cell["fault"]: cell["reason"] for cell in cells}
    changes: dict[str, dict[str, None]] = defaultdict(dict)
    for cell in cells:
        changes[cell["fault"]] |= dict.fromkeys(filter(None, cell["changed"].split("; ")))
    total = {name: sum(c[name] for c in cells) for name in ("runs", "contacts", "before_wall")}
    repeated = sum(c["attempts"] for c in cells) - total["runs"]
    return "\n".join([
        f"{met} of {len(cells)} cells as expected, {total['runs']} runs ({total['before_wall']} "
        f"before a wall), {total['contacts']} contacts, at commit "
        f"{', '.join(sorted({name for c in cells for name in c['commits']}))}. {repeated} attempts "
        "did not come about and were made again.",
        "",
        "Changed in judging since measurements began: " + "; ".join(judge.CHANGED) + ".",
        "",
        f"| fault | {' | '.join(phases)} | why | changed since measurements began |",
        f"|---{'|---' * len(phases)}|---|---|",
        *(
            f"| `{fault}` | {' | '.join(found.get(phase, '') for phase in phases)} | "
            f"{reasons[fault]} | {'; '.join(changes[fault])} |"
            for fault, found in by_fault.items()
        ),
    ])  # fmt: skip


def _in_words(cell: dict[str, Any]) -> str:
    reaction, bound = cell["reaction"], cell["bound_s"]
    if len(cell["reactions"]) > 1:
        reaction = ", ".join(f"{name} ({count})" for name, count in cell["reactions"].items())
    reaction = reaction.replace("_", " ")
    times = ""
    if cell["reaction"] in ("stop", "degrade") and bound is not None:
        if cell["stops"]:
            times = f" {cell['stop_s_median']:.2f}, {cell['stop_s_max']:.2f} of {bound:.2f}"
        else:
            times = _unmeasured(cell)
    if cell["end_bound_s"] is not None and cell["end_s_max"] is not None:
        times += f"; ended {cell['end_s_max']:.2f} of {cell['end_bound_s']:.2f}"
    if cell["as_expected"]:
        return reaction + times
    met = f"{cell['runs_as_expected']} of {cell['runs']} as expected"
    return f"**{reaction}{times}: {met}, {cell['expected'].replace('_', ' ')}**"


def _unmeasured(cell: dict[str, Any]) -> str:
    """What stands where a time would, as nothing had to be stopped."""
    if "finished" in cell["last_motions"]:
        return ": finished, none followed"
    return ": cut short, none followed" if "cut short" in cell["last_motions"] else ": stood, stays"


def draw(cells: Sequence[dict[str, Any]], path: Path) -> None:
    """Faults by phases: colour by as expected or not, the longest time and its bound as text."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    faults = list(dict.fromkeys(cell["fault"] for cell in cells))
    phases = [phase.value for phase in FaultPhase]
    columns = 3
    per_column = -(-len(faults) // columns)
    figure, axes = plt.subplots(
        1, columns, figsize=(15, 1.0 + 0.27 * per_column), squeeze=False, layout="constrained"
    )
    for column, axis in enumerate(axes[0]):
        part = faults[column * per_column : (column + 1) * per_column]
        for cell in cells:
            if cell["fault"] in part:
                _draw_cell(axis, phases.index(cell["phase"]), part.index(cell["fault"]), cell)
        axis.set(xlim=(0, len(phases)), ylim=(per_column, 0))
        axis.set_xticks([k + 0.5 for k in range(len(phases))], phases)
        axis.set_yticks([k + 0.5 for k in range(len(part))], part, fontsize=8)
        axis.xaxis.tick_top()
        axis.tick_params(length=0)
        axis.spines[:].set_visible(False)
    met = sum(cell["as_expected"] for cell in cells)
    figure.suptitle(
        f"{met} of {len(cells)} cells as expected (teal; others orange): reaction, "
        "longest time to rest / bound in seconds; finished: the motion under way did, none followed"
    )
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _draw_cell(axis: Any, x: int, y: int, cell: dict[str, Any]) -> None:
    colour = COLOURS[cell["as_expected"]]
    from matplotlib.patches import Rectangle

    axis.add_patch(Rectangle((x + 0.02, y + 0.05), 0.96, 0.9, color=colour))
    text = cell["reaction"]
    if not cell["as_expected"]:
        text = f"{cell['runs_as_expected']} of {cell['runs']} as expected"
    elif cell["reaction"] not in ("refuse", "ride_through") and cell["bound_s"] is not None:
        timed = f" {cell['stop_s_max']:.2f} / {cell['bound_s']:.2f}" if cell["stops"] else ""
        text += timed or _unmeasured(cell).partition(",")[0]
    text = text.replace("_", " ")
    axis.text(x + 0.5, y + 0.5, text, ha="center", va="center", fontsize=7, color="white")
