"""AKGVP: L-sTDE's network over CLIP's picture and text features.

Source: Xu, Wang et al., Aligning Knowledge Graph with Visual Perception for Object-goal Navigation
(2024), as in its public code, which evaluates without the counterfactual pass.
"""

from __future__ import annotations

from cfnav_core.models.base import Knowledge, ObservationSpec
from cfnav_core.models.lstde import LayoutModel
from cfnav_core.models.parts.reading import table
from cfnav_core.models.size import ModelSize


class AKGVP(LayoutModel):
    """AKGVP: the goal's row is marked with its text feature; the counterfactual pass is off.

    Args:
        inputs: see ``LayoutModel``; picture features of the encoder that made the text features.
        size: widths.
        knowledge: needs layout and text.
        threshold: see ``LayoutModel``.
    """

    title = "AKGVP"

    def __init__(
        self,
        inputs: ObservationSpec,
        size: ModelSize,
        knowledge: Knowledge,
        threshold: float | None = None,
    ) -> None:
        text = table(knowledge, "text", len(inputs.objects), None)
        super().__init__(inputs, size, knowledge, text, threshold)
