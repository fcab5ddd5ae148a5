"""Small halls in place of the built-in rooms."""

from pathlib import Path

import numpy as np

from cfnav_core.scenes.scene import LIDAR
from cfnav_core.task.rooms import SPLITS, parse_rooms, room_folder
from tests.core.worlds import hall


def make_halls(folder: Path) -> None:
    """Those of data2; where nothing trains, a LiDAR that knows the truth."""
    for kind, seed in parse_rooms(["data2"]):
        scene = hall(4, 4, ((1 + seed % 2, 2),), name=f"{kind}:{seed}", seed=0)
        place = room_folder(folder, kind, seed)
        scene.save(place)
        if seed not in SPLITS["data2"]["train"]:
            np.save(place / LIDAR, scene.collided.astype(np.float32))
