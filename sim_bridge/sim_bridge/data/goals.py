"""Which goals rooms offer to a camera: ``cfnav rooms goals --rooms kitchen:0-7 --camera lite``.

The rule: a goal is asked for in a room when ``MIN_GOAL_STATES`` states see it as ``visible`` says,
whatever the camera. Needs no perception, and renders no more than the count asks for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import tyro
from tqdm import tqdm

from cfnav_core.task.camera import CAMERAS, CameraSetUp
from cfnav_core.task.visibility import MIN_GOAL_STATES, VISIBLE_DISTANCE_M
from sim_bridge.data.asked import Furniture, Rooms, asked_for

Sightings = Mapping[str, int]
"""In how many states each thing of a room that can be a goal is visible."""


@dataclass(frozen=True)
class GoalOptions:
    """Count the goals that rooms offer to cameras, without making their scenes."""

    rooms: Rooms = field(default_factory=list)
    furniture: Furniture = "built_in"
    camera: Annotated[list[str], tyro.conf.UseAppendAction] = field(default_factory=list)
    """Whose view: mast, stock_wide, stock_preview, lite, or a JSON file like a scene's camera,
    given as often as needed; all that have names when absent."""

    def run_command(self) -> None:
        """Count and print.

        Raises:
            ValueError: there are no such rooms or cameras.
        """
        from sim_bridge.room.room import generate_room
        from sim_bridge.world.camera import Camera
        from sim_bridge.world.grid import sightings, state_grid
        from sim_bridge.world.world import World

        rooms = asked_for(self.rooms, self.furniture)
        cameras = {name: CameraSetUp.read(name) for name in self.camera or CAMERAS}
        found: dict[str, list[Sightings]] = {name: [] for name in cameras}
        for kind, seed in tqdm(rooms, unit="room", mininterval=2.0):
            room = generate_room(kind, seed)
            for name, set_up in cameras.items():
                world = World(room, set_up.on_mast)
                with Camera(world, set_up) as camera:
                    grid = state_grid(world, set_up.horizons)
                    found[name].append(sightings(world, camera, grid))
        for name, counted in found.items():
            print(f"{name}: {left_out(counted)}")


def left_out(rooms: Sequence[Sightings]) -> str:
    """Say how many goals some rooms offer, and of those left out how many and why."""
    all_of_them = [(name, states) for room in rooms for name, states in room.items()]
    offered = sum(states >= MIN_GOAL_STATES for _, states in all_of_them)
    head = (
        f"{offered} of {len(all_of_them)} goals of {len(rooms)} rooms are asked for, those that "
        f"{MIN_GOAL_STATES} states or more see within {VISIBLE_DISTANCE_M} m"
    )
    rows = []
    for name in sorted({name for name, states in all_of_them if states < MIN_GOAL_STATES}):
        counts = [states for thing, states in all_of_them if thing == name]
        never = sum(states == 0 for states in counts)
        seldom = sum(0 < states < MIN_GOAL_STATES for states in counts)
        why = [f"never seen in {never}"] * bool(never) + [f"too seldom in {seldom}"] * bool(seldom)
        rows.append(f"  {name} is left out in {never + seldom} of {len(counts)}: {', '.join(why)}")
    return "\n".join([head, *rows])
