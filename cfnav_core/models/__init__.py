"""The navigation models by name. A new model is one file and one line here."""

from cfnav_core.models.base import NavModel
from cfnav_core.models.baseline import Baseline

MODELS: dict[str, type[NavModel]] = {"baseline": Baseline}

__all__ = ["MODELS", "NavModel"]
