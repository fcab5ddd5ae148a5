"""The object-relation encoder that HOZ, L-sTDE and AKGVP share."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from cfnav_core.models.reading import Rows


class RelationEncoder(nn.Module):
    """A map of n x n numbers for each object, after objects have passed on their appearance.

    From boxes, confidences and the goal's mark it learns a non-negative matrix that says how much
    each object takes of every object's appearance (no softmax). Source: Du, Yu, Zheng, Learning
    Object Relation Graph and Tentative Policy for Visual Navigation (2020), as used in HOZ.

    Args:
        objects: C.
        appearance: width A.
        info: width I.
        code: width X of what marks the goal at the end of its row.
        side: n.
        mixes: linear layers over the object axis after the first.
    """

    def __init__(
        self, objects: int, appearance: int, info: int, code: int, side: int, mixes: int
    ) -> None:
        super().__init__()
        self.side = side
        self.first = nn.Linear(info + 1, objects)
        self.mix = nn.ModuleList(nn.Linear(objects, objects) for _ in range(mixes))
        self.row = nn.Linear(appearance + info + code, 128)
        self.map = nn.Linear(128, side**2)

    def forward(
        self, rows: Rows, goal: Tensor, codes: Tensor, attention: Tensor | None = None
    ) -> Tensor:
        """Encode.

        Args:
            rows: see ``Rows``.
            goal: float32 [B, C], one-hot.
            codes: float32 [C, X], what stands at the end of an object's row when it is the goal;
                zeros do otherwise.
            attention: float32 [B, C], a factor for each row; None leaves them as they are.

        Returns:
            Float32 [B, C, n, n], of any sign.
        """
        relation = torch.relu(self.first(torch.cat([rows.info, goal[:, :, None]], 2)))
        relation = relation.transpose(1, 2)
        for layer in self.mix:
            relation = torch.relu(layer(relation))
        appearance = relation.transpose(1, 2) @ rows.appearance
        mixed, mark = torch.cat([appearance, rows.info], 2), goal
        if attention is not None:
            mixed, mark = mixed * attention[:, :, None], goal * attention
        # codes are long and stand in one row of many: their product is made once for all episodes
        weight, width = self.row.weight, mixed.shape[2]
        coded = codes @ weight[:, width:].t()
        hidden = F.linear(mixed, weight[:, :width], self.row.bias) + mark[:, :, None] * coded
        return self.map(torch.relu(hidden)).unflatten(2, (self.side, self.side))
