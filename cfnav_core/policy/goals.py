"""Which objects a bundle may be asked to find, and what somebody meant who asked for another.

A word alone is not enough: a goal is found by its own row of the detections, so what the
perception has no row for cannot be looked for, however well a word vector describes it. The
shipped word vectors are not asked for the nearest name either: they say what goes together (a desk
with its lamp, a toilet with its paper), not what is the same.
"""

from __future__ import annotations

import difflib

from cfnav_core.policy.bundle import BundleHead
from cfnav_core.words import plain

OTHER_NAMES = {
    "bin": "GarbageCan", "clock": "AlarmClock", "mobile phone": "CellPhone", "phone": "CellPhone",
    "plant": "HousePlant", "potted plant": "HousePlant", "refrigerator": "Fridge",
    "remote": "RemoteControl", "soap": "SoapBar", "stove": "StoveBurner", "trash can": "GarbageCan",
    "tv": "Television",
}  # fmt: skip
"""Everyday and COCO names of built-in objects that no spelling shows."""

MOST_LISTED = 64
"""A sentence that names more is not read; then those stand in it that the bundle trained with."""

ALIKE = 0.8
"""Least similarity of two spellings, 0..1 (``difflib``)."""


def refusal(goal: str, head: BundleHead) -> str:
    """Why a bundle cannot be asked for a goal, as one sentence; "" when it can.

    It can be asked for what it was trained to find, and, when its model is ``zero_shot``, for all
    else that its perception detects.
    """
    if goal in head.goals or (head.zero_shot and goal in head.objects):
        return ""
    expected = head.objects if head.zero_shot else head.goals
    listed, more = expected, ""
    if len(expected) > MOST_LISTED:
        listed = head.goals
        more = f", or of {len(expected) - len(listed)} others (cfnav info shows them)"
    why = ""
    if goal in head.objects:
        why = ", which the bundle's perception detects but its model was not trained to find"
    meant = closest(goal, expected)
    hint = f" (did you mean {meant}?)" if meant else ""
    return f"found goal {goal!r}{hint}{why}, expected one of {', '.join(listed)}{more}"


def closest(name: str, known: tuple[str, ...]) -> str:
    """The known object that a name is another spelling or an everyday name of; "" for none.

    Case, blanks, hyphens and underscores do not matter.
    """
    words = plain(name)
    if (meant := OTHER_NAMES.get(words, "")) in known:
        return meant
    by_spelling = {plain(k).replace(" ", ""): k for k in known}
    found = difflib.get_close_matches(words.replace(" ", ""), by_spelling, 1, ALIKE)
    return by_spelling[found[0]] if found else ""
