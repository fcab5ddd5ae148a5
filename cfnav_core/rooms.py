"""Room names on command lines: ``kitchen:7`` and ``kitchen:0-19``."""

from __future__ import annotations

from collections.abc import Iterable

from cfnav_core.vocabulary import ROOM_TYPES


def parse_room(text: str) -> tuple[str, int]:
    """Read ``type:seed``.

    Raises:
        ValueError: the text is not a known type, a colon and a whole number.
    """
    kind, _, seed = text.partition(":")
    if kind not in ROOM_TYPES or not seed.isdecimal():
        raise ValueError(
            f"found room {text!r}; expected TYPE:SEED with a type of {', '.join(ROOM_TYPES)} "
            "and a whole number, for example kitchen:21"
        )
    return kind, int(seed)


def parse_rooms(texts: Iterable[str]) -> list[tuple[str, int]]:
    """Read any number of ``type:seed`` and ``type:first-last``.

    Raises:
        ValueError: one is neither, with what was expected.
    """
    rooms = []
    for text in texts:
        first, _, last = text.partition("-")
        kind, seed = parse_room(first)
        end = parse_room(f"{kind}:{last}")[1] if last else seed
        if end < seed:
            raise ValueError(f"found rooms {text!r}; expected the smaller seed first")
        rooms += [(kind, s) for s in range(seed, end + 1)]
    return rooms
