"""Find a named object with one camera, touch nothing on the way.

    import cfnav

    policy = cfnav.load()
    decision = policy.act(picture, goal="Laptop")

docs/python.md shows the rest. Only what is used is loaded: torch, MuJoCo and ROS are not otherwise.

May import: cfnav_core, cfnav_ros, sim_bridge, studies, gymnasium.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING, Any

from cfnav_core import __version__ as __version__

if TYPE_CHECKING:
    from cfnav.bundles import compare as compare
    from cfnav.bundles import evaluate as evaluate
    from cfnav.bundles import load as load
    from cfnav.drives import Bag as Bag
    from cfnav.drives import judge as judge
    from cfnav.environments import make_env as make_env
    from cfnav.environments import make_sb3_env as make_sb3_env
    from cfnav.environments import make_vec_env as make_vec_env

HOME = {
    "load": "bundles", "evaluate": "bundles", "compare": "bundles",
    "make_env": "environments", "make_vec_env": "environments", "make_sb3_env": "environments",
    "Bag": "drives", "judge": "drives",
}  # fmt: skip
"""Public names and their modules."""


def __getattr__(name: str) -> Any:
    if name not in HOME:
        raise AttributeError(f"module 'cfnav' has no attribute {name!r}")
    from cfnav_core.command import missing

    try:
        return getattr(import_module(f"cfnav.{HOME[name]}"), name)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(missing(error), name=error.name) from error


def __dir__() -> list[str]:
    return [*globals(), *HOME]


class _WithGymnasium:
    """Registers the environment when somebody imports Gymnasium, which takes 0.2 s: not before."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        if name != "gymnasium":
            return None
        sys.meta_path.remove(self)
        spec = find_spec(name)
        if spec and spec.loader:
            load = spec.loader.exec_module

            def load_and_register(module: ModuleType) -> None:
                load(module)
                _register()

            spec.loader.exec_module = load_and_register  # type: ignore[method-assign]
        return spec


def _register() -> None:
    import gymnasium

    module = "cfnav_core.learn.gym_env"
    gymnasium.register(
        "cfnav/ObjectNav-v0",
        entry_point=f"{module}:ObjectNav",
        vector_entry_point=f"{module}:ObjectNavVector",
    )


if sys.modules.get("gymnasium"):
    _register()
else:
    sys.meta_path.insert(0, _WithGymnasium())
