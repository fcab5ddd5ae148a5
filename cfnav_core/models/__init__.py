"""The navigation models by name. A new model is one file and one line here."""

from collections.abc import Callable

from cfnav_core.models.base import NavModel
from cfnav_core.models.baseline import Baseline

MODELS: dict[str, Callable[[int], NavModel]] = {"baseline": Baseline}
"""Name to constructor, which takes the LSTM width."""

__all__ = ["MODELS", "NavModel"]
