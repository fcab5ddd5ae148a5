"""The object-relation encoder that HOZ, L-sTDE and AKGVP share."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from cfnav_core.models.parts.reading import Rows


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
        self.objects, self.side = objects, side
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
        mixed, mark = (
            torch.cat([self._relation(rows.info, goal) @ rows.appearance, rows.info], 2),
            goal,
        )
        if attention is not None:
            mixed, mark = mixed * attention[:, :, None], goal * attention
        # codes are long and stand in one row of many: their product is made once for all episodes
        weight, width = self.row.weight, mixed.shape[2]
        coded = mark @ (codes @ weight[:, width:].t())
        hidden = F.linear(mixed.flatten(0, 1), weight[:, :width], self.row.bias)
        episode = torch.arange(goal.shape[0], device=goal.device)
        hidden.index_put_((self.objects * episode + goal.argmax(1),), coded, accumulate=True)
        return self.map(torch.relu_(hidden)).view(-1, self.objects, self.side, self.side)

    def _relation(self, info: Tensor, goal: Tensor) -> Tensor:
        """How much each object takes of every other, float32 [B, C, C], not negative.

        The mixing axis stands first, all others make the columns of one matrix: no layer has to
        copy what the one before it wrote.
        """
        marked = torch.cat([info, goal[:, :, None]], 2).transpose(0, 1).flatten(0, 1)
        relation = torch.relu_(self.first(marked)).view(self.objects, -1)
        for layer in self.mix:
            assert isinstance(layer, nn.Linear)
            relation = torch.relu_(torch.addmm(layer.bias[:, None], layer.weight, relation))
        return relation.view(self.objects, -1, self.objects).transpose(0, 1)
