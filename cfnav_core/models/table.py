"""The navigation models by name. A new model is one file and one line here."""

from cfnav_core.models.akgvp import AKGVP
from cfnav_core.models.base import (
    NavModel,
)
from cfnav_core.models.baseline import BaselineLabel, BaselineWord
from cfnav_core.models.compact import Compact
from cfnav_core.models.hoz import HOZ
from cfnav_core.models.lstde import LSTDE
from cfnav_core.models.mjolnir import MjolnirR
from cfnav_core.models.tdanet import TDANet

MODELS: dict[str, type[NavModel]] = {
    "compact": Compact,
    "baseline_label": BaselineLabel,
    "baseline_word": BaselineWord,
    "hoz": HOZ,
    "lstde": LSTDE,
    "akgvp": AKGVP,
    "mjolnir": MjolnirR,
    "tdanet": TDANet,
}
"""Name to class, which is made of data shapes, widths and tables of knowledge."""
