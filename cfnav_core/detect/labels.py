"""What a detector's classes are called: its numbers or names, and the goals that they stand for.

A detector says a class by number (depthai, every ONNX file) or by name (yolo_ros). A map of labels
is a small YAML file:

    names: [person, bicycle, car]     # from number 0 on; or {1: person, 2: bicycle}
    categories: {cup: Mug}            # what cfnav calls them; all others keep their names

Those that are shipped lie in ``labels``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

SHIPPED = Path(__file__).with_name("labels")


@dataclass(frozen=True)
class LabelMap:
    """Names of a detector's classes.

    Attributes:
        names: by number.
        categories: what cfnav calls some of them, by name.
    """

    names: Mapping[int, str]
    categories: Mapping[str, str] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Columns that scores of all classes have, whether or not each number has a name."""
        return max(self.names, default=-1) + 1

    @cached_property
    def _known(self) -> frozenset[str]:
        return frozenset(self.names.values())

    @cached_property
    def categories_said(self) -> frozenset[str]:
        """All that a detector may say, as cfnav calls it."""
        return frozenset(map(self.category, self.names.values()))

    @property
    def completed(self) -> LabelMap:
        """The same with the categories of the shipped map that has these names, if one has."""
        for name in shipped():
            known = load_labels(name)
            if known._known == self._known:
                return replace(self, categories=known.categories)
        return self

    def name(self, class_id: str) -> str:
        """The name of a class.

        Args:
            class_id: as ``vision_msgs/ObjectHypothesis`` has it: a number or a name.

        Raises:
            ValueError: no class is called so; one sentence.
        """
        word = class_id.strip()
        if word.isdecimal() and int(word) in self.names:
            return self.names[int(word)]
        if word in self._known:
            return word
        low, high = min(self.names, default=0), max(self.names, default=0)
        raise ValueError(
            f"found the class {class_id!r}, expected a number from {low} to {high} or one of the "
            f"{len(self._known)} names of the labels: choose the labels that this detector learnt."
        )

    def category(self, class_id: str) -> str:
        """What cfnav calls a class: the goal that it stands for, or its own name.

        Raises:
            ValueError: no class is called so; one sentence.
        """
        name = self.name(class_id)
        return self.categories.get(name, name)


def shipped() -> list[str]:
    """Names of the maps that are shipped."""
    return sorted(path.stem for path in SHIPPED.glob("*.yaml"))


def load_labels(given: str | Path) -> LabelMap:
    """Read a map of labels.

    Args:
        given: the name of one that is shipped, or a file.

    Raises:
        ValueError: there is none, or it is of no use; one sentence.
    """
    path = SHIPPED / f"{given}.yaml" if given in shipped() else Path(given)
    try:
        said = yaml.safe_load(path.read_text())
    except FileNotFoundError:
        raise ValueError(
            f"found no labels {str(given)!r}, expected a file or one of {', '.join(shipped())}."
        ) from None
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ValueError(f"{path} cannot be read: {' '.join(str(error).split())}.") from None
    try:
        return _label_map(said)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _label_map(said: Any) -> LabelMap:
    if not isinstance(said, dict) or not said.keys() <= {"names", "categories"}:
        raise ValueError("found no map of labels, expected names, and categories if any differ.")
    names, categories = said.get("names"), said.get("categories") or {}
    if isinstance(names, list):
        names = dict(enumerate(names))
    if (
        not isinstance(names, dict) or not names
        or not all(type(n) is int and n >= 0 for n in names)
        or not all(isinstance(name, str) and name for name in names.values())
    ):  # fmt: skip
        raise ValueError("found names that are no list and no numbers with names, expected either.")
    if not isinstance(categories, dict) or not all(
        isinstance(value, str) and value for value in categories.values()
    ):
        raise ValueError("found categories that are no words, expected a name for a name.")
    if strange := categories.keys() - set(names.values()):
        raise ValueError(f"found categories of {sorted(map(str, strange))}, expected names of it.")
    return LabelMap(names, categories)
