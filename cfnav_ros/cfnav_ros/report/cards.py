"""What the page says and shows of each drive: its verdict in words, remarks, camera strip."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from cfnav_core.task.actions import Action
from cfnav_ros.bags.evaluation import BagEvaluation, EvaluatedDrive
from cfnav_ros.bags.judge.contacts import BUMP, CLEARANCE, OBSERVABLE, STALL, TRUTH
from cfnav_ros.bags.judge.outcomes import DriveOutcome
from cfnav_ros.bags.replay.scores import disagreements
from cfnav_ros.bags.replay.step import ReplayStep
from cfnav_ros.report.plot_theme import ACTION_STYLE, DASH, THEMES, TIMES, Theme

CARDS = 20
"""Drives shown with pictures; each adds about 200 kB to the page."""

MOMENTS = 12
"""Disagreements shown with their pictures."""

MEANING = {
    TRUTH: "the simulator's account",
    OBSERVABLE: "what a real robot can know: bump or stall, each touch once",
    BUMP: "the bumper was pressed",
    STALL: "told to move and did not",
    CLEARANCE: "the LiDAR saw the hull touch, or nearly",
    "file": "the episodes file",
    "odometry": "the robot's odometry",
    "LiDAR": "its estimates ahead of the robot",
    "map": "the recorded map",
    "bag": "its stamps, or its log times where the clocks differ or an episodes file cuts it",
}
"""Where a figure comes from, by the word that names it."""


@dataclass(frozen=True)
class Words:
    """A drive's verdict: a short one, a longer one, and the class that colours both."""

    short: str
    long: str
    colour: str


@dataclass(frozen=True)
class KeyPicture:
    """A camera picture of the strip.

    Attributes:
        jpeg: the file.
        t_ns: when it was decided on, nanoseconds of the bag's one time (``clocks``).
        step: 1-based within the drive.
        driven: what was done.
        p_hat: as given to who drove, else to the first bundle.
        note: whether the decision ended in a touch, or was vetoed; else empty.
        answers: of the bundles that decided on it, by name.
    """

    jpeg: bytes
    t_ns: int
    step: int
    driven: Action
    p_hat: float | None
    note: str
    answers: Mapping[str, ReplayStep]


class Disagreement(NamedTuple):
    """A decision that a bundle would have taken otherwise, in a drive with its number."""

    number: int
    evaluated: EvaluatedDrive
    step: ReplayStep


def words_of(outcome: DriveOutcome) -> Words:
    """Say how a drive went."""
    count = outcome.collisions.value
    touched = "touches unknown" if count is None else f"touched {count}{TIMES}" if count else ""
    if not outcome.success.known:
        long = f"goal not judged: {outcome.success.why}"
        colour = "red" if count else "soft"
        return Words(f"{DASH} not judged", f"{long}{', ' + touched if touched else ''}", colour)
    if not outcome.success.value:
        return Words("✗ missed", f"✗ missed{', ' + touched if touched else ''}", "bad")
    if outcome.cf_success.value:
        return Words("✓ clean", "✓ reached, nothing touched", "good")
    return Words(f"✓ but {touched}", f"✓ reached, {touched}", "bad")


def with_pictures(drives: Sequence[EvaluatedDrive], most: int = CARDS) -> set[int]:
    """Choose the drives that are shown with pictures, by their places.

    Those with collisions first, then those that missed their goal, then the others.
    """
    order = sorted(range(len(drives)), key=lambda k: (_rank(drives[k].outcome), k))
    return set(order[:most])


def disagreements_of(drives: Sequence[EvaluatedDrive], most: int = MOMENTS) -> list[Disagreement]:
    """The surest disagreements of all drives whose pictures were kept, one of each picture."""
    found: list[Disagreement] = []
    for number, evaluated in enumerate(drives, 1):
        shown = [s for s in evaluated.steps if s.image_ns in evaluated.pictures]
        found += [Disagreement(number, evaluated, s) for s in disagreements(shown, len(shown))]
    found.sort(key=lambda row: row.step.p_driven)
    surest = {(row.number, row.step.image_ns): row for row in reversed(found)}
    return sorted(surest.values(), key=lambda row: row.step.p_driven)[:most]


def in_themes(draw: Callable[[Theme], bytes]) -> dict[str, str]:
    """A picture as data URIs by theme."""
    return {name: uri(draw(theme), "png") for name, theme in THEMES.items()}


def uri(data: bytes, kind: str) -> str:
    """A picture file as a data URI."""
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"


def signed(action: Action) -> str:
    """An action with its sign."""
    return f"{ACTION_STYLE[action][1]} {action.name}"


def _rank(outcome: DriveOutcome) -> int:
    if outcome.collisions.value:
        return 0
    return 1 if outcome.success.value is False else 2


def remarks(outcome: DriveOutcome) -> list[str]:
    """What is to be said of a drive's facts; that of its success stands in its verdict."""
    facts = {
        "Collisions": outcome.collisions,
        "Path": outcome.driven_m,
        "Shortest path": outcome.shortest_path_m,
        "Impact speed": outcome.impact_speed if outcome.collisions.value else None,
        "Clearance": outcome.clearance_m,
    }
    return [f"{name}: {fact.why}." for name, fact in facts.items() if fact and fact.why]


def key_pictures(evaluated: EvaluatedDrive) -> list[KeyPicture]:
    """The camera strip of a drive."""
    decisions = {d.image_ns: d for d in evaluated.drive.decisions}
    found = []
    for stamp, jpeg in evaluated.pictures.items():
        answers = {s.bundle: s for s in evaluated.steps if s.image_ns == stamp}
        decision, first = decisions.get(stamp), next(iter(answers.values()), None)
        if decision:
            t_ns, step, driven = decision.t_ns, decision.step, decision.action
            p_hat, note = decision.collision_probability, "vetoed" if decision.vetoed else ""
        elif first:
            t_ns, step, driven, p_hat, note = first.t_ns, first.step, first.driven, first.p_hat, ""
        else:
            continue
        if _ended_in_touch(evaluated, t_ns):
            note = "touched"
        found.append(KeyPicture(jpeg, t_ns, step, driven, p_hat, note, answers))
    return found


def _ended_in_touch(evaluated: EvaluatedDrive, t_ns: int) -> bool:
    """Whether a contact came between the decision at a time and the next."""
    decisions = [d.t_ns for d in evaluated.drive.decisions] or [s.t_ns for s in evaluated.steps]
    until = min((t for t in decisions if t > t_ns), default=evaluated.drive.end_ns + 1)
    return any(t_ns <= contact.t_ns < until for contact in evaluated.contacts)


def why_no_pictures(evaluated: EvaluatedDrive, bag: BagEvaluation) -> str:
    """Why a drive has no camera strip, in one sentence."""
    if "image" in bag.missing:
        return "The bag has no topic with camera pictures."
    if not (evaluated.drive.decisions or evaluated.steps):
        return "No decision of this drive is known, and pictures are kept of decisions."
    return "None of the pictures of this drive's decisions is in the bag, or could be read."
