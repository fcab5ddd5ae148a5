"""The rooms from whose pictures perception learns, and batches of them."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cached_property
from pathlib import Path

import numpy as np
import torch

from cfnav_core.perception.augment import Labelled, augment
from cfnav_core.perception.picture_set import FIELDS, HEAD, PictureSet
from cfnav_core.task.camera import CameraSetUp
from cfnav_core.task.rooms import is_test_room, room_folder, rooms_in

HELD_OUT_EVERY = 20
"""The last of so many seeds is held out."""
ROOMS_A_BATCH = 16
LEAST_SETS = 4
RESCAN_S, COMING_S = 30.0, 300.0
"""How often new sets are looked for, and how long the next one may take, seconds."""
AHEAD = 2
"""Batches that are made before they are asked for."""


class Shelf:
    """The picture sets of a folder, to which others may be added."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._looked = -float("inf")
        self._opened: set[Path] = set()
        self.training: list[Path] = []
        self.held_out: list[Path] = []

    def look(self) -> None:
        """See what sets there are, unless that was seen a moment ago.

        Raises:
            ValueError: a set is damaged, of a room that tests, or of another camera than the first.
        """
        if time.monotonic() - self._looked < RESCAN_S:
            return
        self._looked = time.monotonic()
        training, held_out = list[Path](), list[Path]()
        for kind, seed in rooms_in(self._folder, HEAD):
            if is_test_room(kind, seed):
                raise ValueError(
                    f"found pictures of {kind}:{seed} in {self._folder}, a room that tests, from "
                    "which perception must not learn; take them out"
                )
            last = seed % HELD_OUT_EVERY == HELD_OUT_EVERY - 1
            rooms = held_out if last else training
            rooms.append(room_folder(self._folder, kind, seed))
        self.training, self.held_out = training, held_out  # at once: others read them meanwhile
        for folder in sorted({*training, *held_out} - self._opened):
            if PictureSet.load(folder).camera != self.camera:
                raise ValueError(
                    f"found pictures of two cameras in {self._folder}, in {folder.name} of another "
                    "than in the first; give each camera a folder of its own"
                )
            self._opened.add(folder)

    def wait(self, count: int) -> None:
        """Wait until so many sets are there, one of them held out and one not.

        Raises:
            ValueError: fewer than ``LEAST_SETS`` are there, or the next ones do not come within
                ``COMING_S``.
        """
        found, since = -1, time.monotonic()
        while True:
            self.look()
            before, found = found, len(self.training) + len(self.held_out)
            if found >= max(count, LEAST_SETS) and self.held_out and self.training:
                return
            since = since if found == before else time.monotonic()
            if not count or time.monotonic() - since > COMING_S:
                raise ValueError(
                    f"found {len(self.training)} picture sets to learn from and "
                    f"{len(self.held_out)} held out (of seeds that end a score, as 1019) in "
                    f"{self._folder}, expected one or more of each and "
                    f"{max(count, LEAST_SETS)} in all; make them with cfnav rooms make --views 200"
                )
            time.sleep(RESCAN_S)

    @cached_property
    def camera(self) -> CameraSetUp:
        """That took the pictures of the first room, and so of all."""
        return PictureSet.load((self.training or self.held_out)[0]).camera

    def batch(self, size: int, rng: np.random.Generator) -> Labelled:
        """Random pictures of some random rooms.

        Raises:
            ValueError: a set is damaged.
        """
        rooms = rng.choice(len(self.training), min(ROOMS_A_BATCH, len(self.training)))
        parts = []
        for room, part in zip(rooms, np.array_split(np.arange(size), len(rooms)), strict=True):
            pictures = PictureSet.load(self.training[room])
            parts.append((pictures, np.sort(rng.integers(len(pictures.pictures), size=len(part)))))
        return labelled(*parts)

    def batches(self, seen: int, until: int, size: int, seed: int) -> Iterator[Labelled]:
        """Augmented batches, each made by a thread of its own while others are learnt from.

        Args:
            seen: pictures that were seen before; of the same rooms the batch that follows is
                always the same.
            until: pictures to see in all.
            size: pictures a batch.
            seed: of everything that is drawn.

        Raises:
            ValueError: a set is damaged, of a room that tests, or of another camera.
        """

        def made(seen: int) -> Labelled:
            self.look()
            rng = np.random.default_rng([seed, seen])
            generator = torch.Generator().manual_seed(seed * 1_000_003 + seen)
            return augment(self.batch(size, rng), generator)

        # torch asks each thread anew how many cores it may use, and the caller's only now
        torch.get_num_threads()
        beside = ThreadPoolExecutor(1, "batches", torch.set_num_threads, (1,))
        coming: deque[Future[Labelled]] = deque()
        try:
            for start in range(seen, until, size):
                coming.append(beside.submit(made, start))
                if len(coming) > AHEAD:
                    yield coming.popleft().result()
            yield from (future.result() for future in coming)
        finally:
            beside.shutdown(cancel_futures=True)


def labelled(*parts: tuple[PictureSet, np.ndarray]) -> Labelled:
    """Some pictures of some sets with their labels."""
    rows = [{key: getattr(pictures, key)[index] for key in FIELDS} for pictures, index in parts]
    a = {key: torch.from_numpy(np.concatenate([row[key] for row in rows])) for key in FIELDS}
    return Labelled(
        a["pictures"].permute(0, 3, 1, 2).float() / 255,
        a["heat"].permute(0, 3, 1, 2).float(), a["near"].permute(0, 3, 1, 2).float(),
        a["depth"].float(), a["floor"].float() / 255,
    )  # fmt: skip
