"""What the numbers of a detection mean: named fields, whoever made them.

A detection table has a row for each object that is looked for. Its D columns are told by name, so
that nobody reads meaning out of a width.
"""

from __future__ import annotations

Fields = tuple[str, ...]
"""Names of a row's numbers in order; ``appearance*512`` stands for a block of 512."""

SCORES: Fields = ("score", "score_x", "score_y", "size", "near")
"""The built-in perception: confidence 0..1; centre in -1..1 (right and down positive), times score;
square root of the seen share of the picture; confidence that it is visible (within 1.5 m)."""

BOXES: Fields = ("appearance*512", "x1", "y1", "x2", "y2", "confidence")
"""Offline Data 1: how the object looks, its box in pixels of a 300x300 picture, confidence 0..1."""

HULLS: Fields = ("visible", "x", "y", "area")
"""Offline Data 2: 0 or 1, mean x and y and area of its pixels' hull, all in 0..1."""

SIGHTINGS: Fields = ("confidence", "azimuth", "elevation", "width", "height", "distance")
"""Any detector's, by any camera whose field of view is known: confidence 0..1; where the middle of
the box lies, rad from straight ahead on the level, right and up positive; how wide and high it is,
rad; how far its thing is from the robot's middle, metres, 0 where nobody knows."""


def columns(fields: Fields) -> dict[str, slice]:
    """Columns of each field, by its name without the width of a block.

    Raises:
        ValueError: a name stands twice, or a block has no width.
    """
    found: dict[str, slice] = {}
    start = 0
    for name in fields:
        word, star, count = name.partition("*")
        if word in found or not word or (star and not count.isdecimal()):
            raise ValueError(f"found detection fields {list(fields)}, expected each name once")
        found[word] = slice(start, start := start + (int(count) if star else 1))
    return found


def width(fields: Fields) -> int:
    """D."""
    return max((at.stop for at in columns(fields).values()), default=0)


DETECTED_ABOVE = {"score": 0.5, "confidence": 0.0, "visible": 0.0}
"""Field that says how surely an object is seen, 0..1, to the threshold above which it counts."""


def confidence_column(fields: Fields) -> int:
    """Column that says how surely an object is seen.

    Raises:
        ValueError: there are fields and none says so.
    """
    at = columns(fields)
    for name in DETECTED_ABOVE:
        if name in at:
            return at[name].start
    if fields:
        raise ValueError(
            f"found detections with the fields {', '.join(fields)}, expected one of "
            f"{', '.join(DETECTED_ABOVE)} among them"
        )
    return 0


def fields_before_names(columns: int) -> Fields:
    """What a table of this width held in files that were made before fields had names.

    Raises:
        ValueError: no such file had this width.
    """
    for fields in ((), SCORES, BOXES, HULLS):
        if width(fields) == columns:
            return fields
    raise ValueError(
        f"found detections of {columns} numbers without their names; make the scenes again, or "
        "name the fields in scene.json"
    )
