"""Frozen dataclasses as settings: names, types, ranges; of nodes, as ROS parameters, and of robots.

A field that is itself a dataclass gives its name as a prefix: ``motion.v_max``; one that is neither
that nor made by ``setting`` is no setting. The nodes' ``parameters`` modules speak ROS.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import Field, field, fields, is_dataclass, replace
from typing import Any, TypeVar

T = TypeVar("T")

OF_RCLPY = ("use_sim_time", "start_type_description_service", "qos_overrides")
"""Parameters that every node of rclpy has (the part before the first dot)."""


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


def leaves(value: Any, prefix: str = "") -> Iterator[tuple[str, tuple[Field, Any]]]:
    """Dotted name, field and value of every parameter in a dataclass."""
    for spec in fields(value):
        default = getattr(value, spec.name)
        if is_dataclass(default):
            yield from leaves(default, f"{prefix}{spec.name}.")
        elif spec.metadata:
            yield f"{prefix}{spec.name}", (spec, default)


def build(defaults: T, values: Mapping[str, Any], prefix: str = "") -> T:
    """A dataclass like ``defaults`` with the values of all its leaves, by dotted name.

    Raises:
        ValueError: the dataclass refuses a value.
    """
    arguments = {}
    for spec in fields(defaults):  # type: ignore[arg-type]
        inner, name = getattr(defaults, spec.name), f"{prefix}{spec.name}"
        if is_dataclass(inner):
            arguments[spec.name] = build(inner, values, f"{name}.")
        elif spec.metadata:
            arguments[spec.name] = values[name]
    return replace(defaults, **arguments)  # type: ignore[type-var]


def flat(values: Mapping[Any, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted names and values of a nested mapping."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def settled(defaults: T, given: Mapping[str, Any]) -> T:
    """A dataclass like ``defaults`` with what was given, by dotted name; ``OF_RCLPY`` is left out.

    Raises:
        ValueError: an unknown name, a wrong type or a value that the range or the dataclass
            refuses; one sentence.
    """
    known = dict(leaves(defaults))
    for name in given:
        if name not in known and name.split(".")[0] not in OF_RCLPY:
            raise ValueError(f"There is no parameter {name!r}; there are {', '.join(known)}.")
    values = {
        name: checked(name, given.get(name, default), spec, default)
        for name, (spec, default) in known.items()
    }
    return build(defaults, values)


def checked(name: str, value: Any, spec: Field, default: Any) -> Any:
    """The value in the type of the default and within the field's range, or ValueError."""
    value = typed(name, value, default)
    low, high = spec.metadata.get("min"), spec.metadata.get("max")
    below, above = low is not None and not value >= low, high is not None and not value <= high
    if not (below or above):
        return value
    if low is None or high is None:
        wanted = f"at most {high:g}" if low is None else f"at least {low:g}"
    else:
        wanted = f"{low:g} to {high:g}"
    raise ValueError(f"{name} is {value}, expected {wanted}.")


def typed(name: str, value: Any, default: Any) -> Any:
    """The value, or ValueError; a whole number will do for a float, any list for a tuple."""
    if isinstance(default, float) and type(value) is int:
        return float(value)
    if isinstance(default, tuple) and not isinstance(value, (str, bool, int, float)):
        return tuple(value)
    if type(value) is not type(default):
        raise ValueError(
            f"{name} is {value!r}, expected {type(default).__name__}, such as {default!r}."
        )
    return value
