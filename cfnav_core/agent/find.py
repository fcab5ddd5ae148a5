"""Models and methods by name: a row of the project's tables, or one of the user's own.

``compact`` is a row; ``mine.py:Mine`` is what a file calls ``Mine``, and ``package.module:Mine``
what a module does. Nothing in the project changes for it. A checkpoint remembers the name, so
the file or module must be there wherever the checkpoint is loaded; an exported bundle needs none.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from cfnav_core.agent.methods import METHODS, Method
from cfnav_core.models.base import NavModel
from cfnav_core.models.table import MODELS

Row = TypeVar("Row")


def find_model(name: str) -> type[NavModel]:
    """A row of ``MODELS``, or the user's own class.

    Raises:
        ValueError: there is none of this name, or it is no ``NavModel``.
    """
    found = _find("model", name, MODELS)
    if not (isinstance(found, type) and issubclass(found, NavModel)):
        raise ValueError(f"found {found!r} at {name}, expected a class made from NavModel")
    return found


def find_method(name: str) -> Method:
    """A row of ``METHODS``, or the user's own.

    Raises:
        ValueError: there is none of this name, or it is no ``Method``.
    """
    found = _find("method", name, METHODS)
    if not isinstance(found, Method):
        raise ValueError(f"found {found!r} at {name}, expected a Method (cfnav_core.agent.methods)")
    return found


def _find(what: str, name: str, table: Mapping[str, Row]) -> Row | Any:
    if name in table:
        return table[name]
    where, colon, attribute = name.rpartition(":")
    if not colon:
        raise ValueError(
            f"found {what} {name!r}, expected one of {', '.join(table)}, or one of your own as "
            "FILE.py:NAME or package.module:NAME"
        )
    module = _load(where)
    if not hasattr(module, attribute):
        raise ValueError(f"found no {attribute} in {where}, which was given as {what} {name!r}")
    return getattr(module, attribute)


@cache
def _load(where: str) -> ModuleType:
    """A module by its dotted name or by its file; each is loaded once.

    Raises:
        ValueError: it is not there, or fails while it is loaded.
    """
    try:
        if not where.endswith(".py"):
            return importlib.import_module(where)
        path = Path(where).resolve()
        spec = importlib.util.spec_from_file_location(f"cfnav_users_{path.stem}", path)
        if spec is None or spec.loader is None:
            raise ImportError(f"{path} is no Python file")
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module  # dataclasses look their module up there
        spec.loader.exec_module(module)
    except Exception as error:  # whatever a user's file raises, the command says where
        raise ValueError(f"found no usable module at {where}: {error!r}") from error
    return module
