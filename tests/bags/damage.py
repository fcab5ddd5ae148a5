"""Damage to files as it happens."""

from __future__ import annotations

import random


def mutated(data: bytes, rng: random.Random) -> bytes:
    """Damage as it happens: bytes flipped, overwritten, lost, put in twice, cut off."""
    out = bytearray(data)
    for _ in range(rng.choice([1, 1, 1, 2, 5])):
        at, length = rng.randrange(len(out)), rng.choice([1, 4, 8, 100, 1000])
        what = rng.randrange(5)
        if what == 0:
            out[at] ^= 1 << rng.randrange(8)
        elif what == 1:
            fill = rng.choice([b"\0", b"\xff", bytes([rng.randrange(256)])])
            out[at : at + length] = fill * len(out[at : at + length])
        elif what == 2:
            del out[at : at + length]
        elif what == 3:
            out[at:at] = out[at : at + length]
        else:
            del out[max(at, 1) :]
    return bytes(out)
