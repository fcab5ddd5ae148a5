"""The rooms that a command of ``cfnav rooms`` is asked for, and something made of each of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from cfnav_core.perception.picture_set import HEAD, PictureSet
from cfnav_core.scenes.scene import OfflineScene
from cfnav_core.task.camera import CameraSetUp
from cfnav_core.task.detections import SIGHTINGS
from cfnav_core.task.rooms import BUILT_IN, SWEET_HOME, parse_rooms, room_folder, shift_of
from sim_bridge.room.room import check_furniture

Rooms = Annotated[
    list[str],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(
        help="TYPE:SEED, TYPE:FIRST-LAST or a split such as data2:train, given as often as "
        "needed. sweet_home.TYPE and sweet_home.SPLIT name a furniture, too."
    ),
]

Furniture = Annotated[
    Literal["built_in", "sweet_home", "both", "cc0", "varied"],
    tyro.conf.arg(
        help="Of rooms that name none: our own, models of the Debian package "
        "sweethome3d-furniture, or a room of each of these; cc0: the few of its models that come "
        "with cfnav; varied: the package's in other paint and proportions, from which perception "
        "learns shapes."
    ),
]


def asked_for(rooms: Sequence[str], furniture: str) -> list[tuple[str, int]]:
    """Rooms by their names, and that of their furniture where they name none.

    Args:
        rooms: as ``Rooms`` says. furniture: as ``Furniture`` says.

    Returns:
        Kind and seed of each.

    Raises:
        ValueError: there are none, one is not known, or its furniture is not installed.
    """
    if not rooms:
        raise ValueError("found no rooms; say which, for example --rooms kitchen:20-23")
    found = parse_rooms(rooms, (BUILT_IN, SWEET_HOME) if furniture == "both" else (furniture,))
    check_furniture(kind for kind, _ in found)
    return found


def keep_others(
    rooms: Sequence[tuple[str, int]], out: Path, kind: str, camera: CameraSetUp,
    visual_shift: float = 0.0,
) -> None:  # fmt: skip
    """See that nothing of another kind is where rooms are to be made.

    What is of the same kind, but of another version or perception, may be made again.

    Args:
        rooms: kind and seed of each.
        out: folder of their folders.
        kind: of what is to be made, "scenes", "sightings" or "views".
        camera, visual_shift: that it is to be seen by.

    Raises:
        ValueError: there is something; the first room is named.
    """
    for room in rooms:
        folder = room_folder(out, *room)
        try:
            if (folder / HEAD).exists():
                there: PictureSet | OfflineScene = PictureSet.load(folder)
            else:
                there = OfflineScene.load(folder)
        except ValueError:  # nothing, or damaged
            continue
        if isinstance(there, PictureSet):
            found = "views"
        else:
            found = "sightings" if there.fields == SIGHTINGS else "scenes"
        shift = shift_of(there.source)
        if (found, there.camera, shift) != (kind, camera, visual_shift):
            raise ValueError(
                f"found {found} of {there.camera}, shifted by {shift}, in {folder}, expected "
                f"nothing or {kind} of {camera}, shifted by {visual_shift}; give another --out, or "
                "delete that folder"
            )


def made_of_each(
    make: Callable[..., Any], rooms: Sequence[tuple[str, int]], *also: Any, processes: int
) -> Iterator[Any]:
    """What a function makes of each room, in several processes, as soon as it is there.

    Of a run that is stopped, rooms in work are finished and the others not begun.

    Args:
        make: called with a room's kind and seed, and ``also``.
        rooms: each of them. processes: of them at the same time, 1 or more.

    Raises:
        ValueError: one cannot be made (named in the message), or there are no processes.
    """
    if processes < 1:
        raise ValueError(f"found --processes {processes}, expected 1 or more")
    rest, jobs = iter(rooms), dict[Future[Any], tuple[str, int]]()
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:

        def begin(count: int) -> None:  # a pool would begin some of what waits in it, too
            jobs.update((pool.submit(make, *room, *also), room) for room in islice(rest, count))

        begin(processes)
        while jobs:
            done = wait(jobs, return_when=FIRST_COMPLETED).done
            for job in done:
                made = _result(job, jobs.pop(job))
                begin(1)
                yield made


def _result(job: Future[Any], room: tuple[str, int]) -> Any:
    try:
        return job.result()
    except Exception as error:
        kind, seed = room
        raise ValueError(f"room {kind}:{seed} could not be made: {error}") from error
