"""What the page shows of each drive: its verdict in words, pictures, camera strip."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from cfnav_core.actions import Action
from cfnav_ros.bags.contacts import BUMP, CLEARANCE, OBSERVABLE, STALL, TRUTH
from cfnav_ros.bags.evaluation import EvaluatedDrive, Evaluation
from cfnav_ros.bags.outcomes import DriveOutcome
from cfnav_ros.bags.replay_step import ReplayStep
from cfnav_ros.bags.scores import disagreements
from cfnav_ros.plot_theme import ACTION_STYLE, DASH, THEMES, TIMES, Theme
from cfnav_ros.timeline_plot import timeline_png
from cfnav_ros.trajectory_plot import course_of, trajectory_png

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
class Answer:
    """What one bundle would have done at one decision."""

    bundle: str
    same: bool
    text: str


@dataclass(frozen=True)
class Frame:
    """One camera picture of the strip."""

    uri: str
    seconds: float
    step: int
    driven: str
    p_hat: float | None
    note: str
    answers: tuple[Answer, ...]


@dataclass(frozen=True)
class Card:
    """Everything the page shows of one drive; pictures as data URIs by theme.

    Attributes:
        number: of the drive in the report.
        bag: name of its bag.
        evaluated: the drive.
        words: its verdict.
        trajectory: from above; ``course`` says what it shows.
        timeline: over time.
        remarks: facts that are missing, and why, or that need a word.
        frames: camera strip.
        no_frames: why it is empty.
    """

    number: int
    bag: str
    evaluated: EvaluatedDrive
    words: Words
    trajectory: Mapping[str, str]
    timeline: Mapping[str, str]
    course: str
    remarks: tuple[str, ...]
    frames: Sequence[Frame]
    no_frames: str


@dataclass(frozen=True)
class Moment:
    """A decision that a bundle would surely have taken otherwise, with its picture."""

    number: int
    seconds: float
    uri: str
    step: ReplayStep
    driven: str
    own: str


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


def card(number: int, bag: Evaluation, evaluated: EvaluatedDrive) -> Card:
    """Put one drive's card together.

    Args:
        number: of the drive in the report.
        bag: that it is from.
        evaluated: the drive.
    """
    frames = _frames(evaluated, tuple(bag.bundles))
    return Card(
        number=number,
        bag=bag.name,
        evaluated=evaluated,
        words=words_of(evaluated.outcome),
        trajectory=in_themes(lambda theme: trajectory_png(evaluated, theme)),
        timeline=in_themes(lambda theme: timeline_png(evaluated, tuple(bag.bundles), theme)),
        course=course_of(evaluated).words,
        remarks=_remarks(evaluated.outcome),
        frames=frames,
        no_frames="" if frames else _no_frames(bag, evaluated),
    )


def moments(drives: Sequence[EvaluatedDrive], most: int = MOMENTS) -> list[Moment]:
    """The surest disagreements of all drives whose pictures were kept, one of each picture."""
    found: list[tuple[int, EvaluatedDrive, ReplayStep]] = []
    for number, evaluated in enumerate(drives, 1):
        shown = [s for s in evaluated.steps if s.image_ns in evaluated.pictures]
        found += [(number, evaluated, s) for s in disagreements(shown, len(shown))]
    found.sort(key=lambda row: row[2].p_driven)
    first = {(number, step.image_ns): (number, e, step) for number, e, step in reversed(found)}
    chosen = sorted(first.values(), key=lambda row: row[2].p_driven)[:most]
    return [
        Moment(
            number=number,
            seconds=(step.t_ns - evaluated.drive.start_ns) * 1e-9,
            uri=uri(evaluated.pictures[step.image_ns], "jpeg"),
            step=step,
            driven=signed(step.driven),
            own=signed(step.action),
        )
        for number, evaluated, step in chosen
    ]


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


def _remarks(outcome: DriveOutcome) -> tuple[str, ...]:
    """What is to be said of a drive's facts; that of its success stands in its verdict."""
    facts = {
        "Collisions": outcome.collisions,
        "Path": outcome.driven_m,
        "Shortest path": outcome.shortest_path_m,
        "Impact speed": outcome.impact_speed if outcome.collisions.value else None,
        "Clearance": outcome.clearance_m,
    }
    return tuple(f"{name}: {fact.why}." for name, fact in facts.items() if fact and fact.why)


def _frames(evaluated: EvaluatedDrive, bundles: Sequence[str]) -> list[Frame]:
    decisions = {d.image_ns: d for d in evaluated.drive.decisions}
    frames = []
    for stamp, jpeg in evaluated.pictures.items():
        steps = {s.bundle: s for s in evaluated.steps if s.image_ns == stamp}
        decision, step = decisions.get(stamp), next(iter(steps.values()), None)
        known = decision or step
        if known is None:
            continue
        driven = decision.action if decision else step.driven if step else Action.Done
        p_hat = decision.collision_probability if decision else step.p_hat if step else None
        frames.append(
            Frame(
                uri=uri(jpeg, "jpeg"),
                seconds=(known.t_ns - evaluated.drive.start_ns) * 1e-9,
                step=known.step,
                driven=signed(driven),
                p_hat=p_hat,
                note=_note(evaluated, known.t_ns, bool(decision and decision.vetoed)),
                answers=tuple(_answer(name, steps.get(name)) for name in bundles),
            )
        )
    return frames


def _answer(bundle: str, step: ReplayStep | None) -> Answer:
    if step is None:
        return Answer(bundle, True, "no answer")
    sure = float(step.probabilities[step.action])
    if step.agrees:
        return Answer(bundle, True, f"the same ({sure:.2f})")
    return Answer(bundle, False, f"{signed(step.action)} ({sure:.2f})")


def _note(evaluated: EvaluatedDrive, t_ns: int, vetoed: bool) -> str:
    """Whether the decision at a time ended in a touch, or was vetoed."""
    decisions = [d.t_ns for d in evaluated.drive.decisions] or [s.t_ns for s in evaluated.steps]
    until = min((t for t in decisions if t > t_ns), default=evaluated.drive.end_ns + 1)
    if any(t_ns <= contact.t_ns < until for contact in evaluated.contacts):
        return "touched"
    return "vetoed" if vetoed else ""


def _no_frames(bag: Evaluation, evaluated: EvaluatedDrive) -> str:
    """Why a drive has no camera strip."""
    if "image" in bag.missing:
        return "The bag has no topic with camera pictures."
    if not (evaluated.drive.decisions or evaluated.steps):
        return "No decision of this drive is known, and pictures are kept of decisions."
    if not evaluated.pictures:
        return "None of the pictures of this drive's decisions is in the bag, or could be read."
    return ""
