"""HOZ: object relations and a graph of zones with a sub-goal.

Source: Zhang, Song, Bai, Li, Chu, Jiang, Hierarchical Object-to-Zone Graph for Object Navigation
(2021). Two departures from its public code: shortest ways are clean (``graphs.first_hops``), and
the nodes' update is state of an episode and advances once a step.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.functional import one_hot

from cfnav_core.models.base import Knowledge, ModelInput, NavModel, ObservationSpec, State
from cfnav_core.models.parts.graphs import (
    first_hops,
    goal_zone,
    lookup,
    nearest_zone,
    normalised,
    zone_change,
)
from cfnav_core.models.parts.heads import ActionEmbedding, ActorCritic, gate_done, initialise
from cfnav_core.models.parts.picture import Fusion, PictureMap
from cfnav_core.models.parts.reading import Rows, columns_of, table
from cfnav_core.models.parts.relation import RelationEncoder
from cfnav_core.models.size import ModelSize

UPDATE_RATE = 0.005
"""Share of what is seen in an updated zone."""


class RoomClassifier(nn.Module):
    """Picture and boxes to room types; nothing teaches it but the reward.

    Args:
        objects: C.
        info: width I of box and confidence.
        channels: of the picture's map.
        side: n of the picture's map.
        rooms: R.
    """

    def __init__(self, objects: int, info: int, channels: int, side: int, rooms: int) -> None:
        super().__init__()
        self.info = nn.Linear(info, side**2)
        self.pointwise = nn.Conv2d(objects + channels, channels, 1)
        self.room = nn.Linear(channels * side**2, rooms)

    def forward(self, info: Tensor, picture: Tensor) -> Tensor:
        """Info [B, C, I] and picture [B, k, n, n] to probabilities [B, R]."""
        boxes = torch.relu(self.info(info)).unflatten(2, picture.shape[2:])
        mixed = torch.relu(self.pointwise(torch.cat([boxes, picture], 1)))
        return torch.softmax(self.room(mixed.flatten(1)), 1)


class HOZ(NavModel):
    """HOZ. Its room type is the one it predicts, as published.

    State ``zones`` [4, Z, C] is how far the nodes of each room type have moved from the shipped
    ones in this episode.

    Args:
        inputs: detections of a known table.
        size: widths.
        knowledge: needs zones and zone_edges.
    """

    zones: Tensor
    hops: Tensor
    adjacency: Tensor
    mark: Tensor

    reward = "hoz"
    title = "HOZ"

    def __init__(self, inputs: ObservationSpec, size: ModelSize, knowledge: Knowledge) -> None:
        super().__init__()
        objects, k, rooms = len(inputs.objects), size.channels, len(inputs.room_types)
        self.columns = columns_of(inputs.fields)
        appearance, info, _ = self.columns.widths
        zones = table(knowledge, "zones", rooms, None, objects)
        edges = table(knowledge, "zone_edges", rooms, zones.shape[1], zones.shape[1])
        self.register_buffer("zones", zones, persistent=False)
        self.register_buffer("hops", torch.stack([*map(first_hops, edges)]), persistent=False)
        self.register_buffer("adjacency", normalised(edges), persistent=False)
        self.register_buffer("mark", torch.ones(objects, 1), persistent=False)
        self.picture = PictureMap(inputs.features, k)
        side = self.picture.side
        self.relation = RelationEncoder(objects, appearance, info, 1, side, mixes=4)
        self.room = RoomClassifier(objects, info, k, side, rooms)
        self.zone = nn.Linear(objects, objects, bias=False)
        # declared as trainable and read without its gradient, as published, so that it stays
        self.update_rate = nn.Parameter(torch.tensor(UPDATE_RATE))
        self.action = ActionEmbedding()
        parts = (k, objects, self.action.width, rooms, objects)
        self.fusion = Fusion(parts, k, side, size.dropout)
        self.policy = ActorCritic(self.fusion.width, size.hidden, layers=2)
        self.state_shapes = {**self.policy.state_shapes, "zones": tuple(zones.shape)}
        initialise(self, self.room, self.zone)

    def forward(self, seen: ModelInput, state: State) -> tuple[Tensor, Tensor, State]:
        """See ``NavModel.forward``."""
        rows = self.columns.read(seen.detections)
        picture = self.picture(seen.features)
        relation = torch.relu(self.relation(rows, seen.goal, self.mark))
        room = self.room(rows.info, picture)
        subgoal, moved = self.subgoal(room.argmax(1), rows, seen.goal, state["zones"])
        x = self.fusion(picture, relation, self.action(seen.previous_action), room, subgoal)
        logits, value, memory = self.policy(x, seen.collision_probability, state)
        return gate_done(logits, rows.confidence, seen.goal), value, {**memory, "zones": moved}

    def subgoal(
        self, room: Tensor, rows: Rows, goal: Tensor, moved: Tensor
    ) -> tuple[Tensor, Tensor]:
        """The graph network's row of the next zone on the way to the goal's.

        Args:
            room: int64 [B].
            rows: see ``Rows``.
            goal: float32 [B, C], one-hot.
            moved: float32 [B, R, Z, C], see the class.

        Returns:
            The row, float32 [B, C], and ``moved`` after this step.
        """
        in_room = one_hot(room, moved.shape[1])[:, :, None, None]
        nodes = self.zones[room] + (moved * in_room).sum(1)
        here = nearest_zone(rows.detected, nodes)
        change = zone_change(rows.detected, nodes, here, self.update_rate.detach())
        nodes = nodes + change
        hop = lookup(self.hops, room, here, goal_zone(nodes, goal))
        neighbours = lookup(self.adjacency, room, hop)
        row = torch.relu(self.zone((neighbours[:, None] @ nodes)[:, 0]))
        return row, moved + in_room * change[:, None]
