"""Blocked moves that the LiDAR's plane does not show."""

from dataclasses import replace

from sim_bridge.data.overhangs import blocked_moves, crosses_plane
from sim_bridge.room.room import generate_room


def test_what_the_plane_does_not_cross_is_unseen():
    room = generate_room("living_room", 21)
    low = [p for p in room.parts if crosses_plane(p)]
    high = [p for p in room.parts if p.solid and p.centre[2] - p.half[2] > 0.351]
    assert low
    assert high
    assert not set(map(id, low)) & set(map(id, high))
    found = blocked_moves(room)
    assert 0 < found.unseen < found.moves
    # where nothing reaches over the plane, the LiDAR sees every blocked move
    assert blocked_moves(replace(room, parts=tuple(low))).unseen == 0


def test_a_floating_board_is_unseen_and_a_box_is_not():
    room = generate_room("bathroom", 21)
    walls = tuple(p for p in room.parts if room.objects[p.owner].name in ("Wall", "Floor"))
    box = replace(
        room.parts[0], shape="box", yaw=0.0, texture=None, repeat=None, solid=True,
        half=(0.2, 0.2, 0.2), owner=walls[0].owner,
    )  # fmt: skip
    middle = (room.width / 2, room.depth / 2)
    empty = blocked_moves(replace(room, parts=walls))
    board = replace(box, centre=(*middle, 0.9), half=(0.3, 0.3, 0.02))
    floating = blocked_moves(replace(room, parts=(*walls, board)))
    standing = blocked_moves(replace(room, parts=(*walls, replace(box, centre=(*middle, 0.2)))))
    assert empty.unseen == standing.unseen == 0
    assert floating.unseen > 0
    assert standing.moves > empty.moves
