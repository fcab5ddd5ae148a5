"""One field of a dataclass that becomes parameters of a node. Pure; ``parameters`` reads them."""

from __future__ import annotations

from dataclasses import field
from typing import Any


def setting(
    default: Any,
    help: str,
    low: float | None = None,
    high: float | None = None,
    live: bool = False,
) -> Any:
    """A dataclass field with what its ROS parameter says of itself.

    Args:
        default: of the type that the parameter has.
        help: its description, with unit.
        low: smallest value, None for any.
        high: largest value, None for any.
        live: whether it may be changed while the node runs.
    """
    about = {"help": help, "min": low, "max": high, "live": live}
    return field(default=default, metadata=about)
