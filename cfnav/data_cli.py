"""``cfnav data``: look at data sets, check and convert published ones, freeze their episodes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import tyro
from tqdm import tqdm

from cfnav_core.agent.config import Rooms
from cfnav_core.command import DONE, PARTLY
from cfnav_core.published import start_states
from cfnav_core.published.check import check_root, check_scene
from cfnav_core.published.convert import convert
from cfnav_core.published.reader import Choice, read_room
from cfnav_core.published.workers import in_order
from cfnav_core.scenes.check import check_alike, check_rooms, check_store
from cfnav_core.scenes.layouts import (
    LAYOUTS,
    Layout,
    SceneFolder,
    objects_of,
    recognise,
    scene_folders,
    scenes_root,
)
from cfnav_core.scenes.pack import pack
from cfnav_core.scenes.scene import OfflineScene, SceneError
from cfnav_core.scenes.store import HEAD, StoreHead
from cfnav_core.task.rooms import SPLITS, room_folder, rooms_in, split_of

LayoutName = Literal["data1", "data2", "savn"]


@dataclass(frozen=True)
class PublishedData:
    """An unpacked published data set and what to read of it."""

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder that the data set was unpacked into."""
    layout: LayoutName | None = None
    """Which data set it is, where its files do not tell."""
    features: str | None = None
    """File of picture features, for example clip_featuremap.hdf5; the first found when absent."""
    processes: int = 2
    """Scenes read at the same time; each takes 50 to 200 kB of memory a state."""

    def contents(self, drop_bad: bool = False) -> tuple[Path, list[SceneFolder], Choice]:
        """Its root, its scenes and what to read of them."""
        root, layout = open_root(self.folder, self.layout)
        choice = Choice(layout, objects_of(layout, root), self.features, drop_bad)
        return root, scene_folders(root, layout), choice


def open_root(folder: Path, name: LayoutName | None) -> tuple[Path, Layout]:
    """Folder of the scenes, and their layout."""
    layout = LAYOUTS[name] if name else None
    root = scenes_root(folder, layout)
    return root, layout or recognise(root)


@dataclass(frozen=True)
class InfoData:
    """List the scenes of a data set: published, converted or built-in.

    A scene that cannot be read has a row that says why; exit code 1 when there is one.
    """

    folder: Annotated[Path, tyro.conf.Positional]
    """A published data set, a store, or a folder of built-in scenes."""
    layout: LayoutName | None = None
    """Which published data set it is, where its files do not tell."""

    def run_command(self) -> int:
        """Print the table."""
        if (self.folder / HEAD).exists():
            head = StoreHead.load(self.folder)
            title = f"store of {head.made_from}"
            rows: list[Row | Damaged] = list(_stored(head))
        elif rooms_in(self.folder):
            title, rows = "built-in scenes", list(_built_in(self.folder))
        else:
            root, layout = open_root(self.folder, self.layout)
            title, rows = f"published {layout.name}", list(_published(root, layout))
        print(f"{self.folder}: {title}")
        print(table(rows))
        return PARTLY if any(isinstance(row, Damaged) for row in rows) else DONE


Row = tuple[str, str, str, int, int, int]


class Damaged(NamedTuple):
    """In place of the row of a scene that cannot be read."""

    name: str
    room_type: str
    split: str
    why: str


COLUMNS = ("scene", "room type", "split", "positions", "states", "targets")


def _stored(head: StoreHead) -> Iterator[Row]:
    for s in head.scenes:
        yield s.name, s.room_type, s.split, s.positions, s.states, len(s.goals)


def _built_in(folder: Path) -> Iterator[Row | Damaged]:
    for kind, seed in rooms_in(folder):
        found = (f"{name}:{split}" for name in SPLITS if (split := split_of(name, seed)))
        splits = " ".join(found) or "-"
        try:
            yield _row(OfflineScene.load(room_folder(folder, kind, seed)), splits)
        except SceneError as error:
            yield Damaged(f"{kind}:{seed}", kind, splits, str(error))


def _published(root: Path, layout: Layout) -> Iterator[Row | Damaged]:
    choice = Choice(layout, objects_of(layout, root), drop_bad=True)
    for folder in tqdm(scene_folders(root, layout), unit="scene", leave=False):
        try:
            yield _row(read_room(folder, choice)[1], folder.split)
        except SceneError as error:
            yield Damaged(folder.name, folder.room_type, folder.split, str(error))


def _row(scene: OfflineScene, split: str) -> Row:
    positions = len(scene.positions)
    return scene.name, scene.room_type, split, positions, scene.num_states, len(scene.goals)


def table(rows: Sequence[Row | Damaged]) -> str:
    """Aligned columns with a last line of sums; sentences stand behind all columns."""
    whole = [row for row in rows if not isinstance(row, Damaged)]
    sums = sum(row[3] for row in whole), sum(row[4] for row in whole)
    total = (f"{len(rows)} scenes", "", "", *sums, "")
    numbers = [(*r[:3], "-", "-", "-", r.why) if isinstance(r, Damaged) else (*r, "") for r in rows]
    lines = [tuple(map(str, row)) for row in ((*COLUMNS, ""), *numbers, (*total, ""))]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if 3 <= i < 6 else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )


@dataclass(frozen=True)
class CheckData(PublishedData):
    """Say what is missing, inconsistent or changed in a data set: published, store or built-in.

    Exit code 1 when there is anything.
    """

    quick: bool = False
    """Leave the numbers unread: keys and shapes only."""

    def run_command(self) -> int:
        """Print one line for each problem."""
        if (self.folder / HEAD).exists():
            problems = check_store(self.folder, self.quick)
        elif rooms_in(self.folder):
            problems = check_rooms(self.folder, self.quick)
        else:
            problems = self._problems()
        for line in problems:
            print(line)
        print(f"{self.folder}: {len(problems) or 'no'} problem{'s' * (len(problems) != 1)}")
        return PARTLY if problems else DONE

    def _problems(self) -> list[str]:
        root, folders, choice = self.contents()
        work = partial(check_scene, choice=choice, quick=self.quick)
        bar = tqdm(in_order(work, folders, self.processes), total=len(folders), unit="scene")
        checked = {folder.name: one for folder, one in bar}
        lines = [f"{name}: {line}" for name, one in checked.items() for line in one.problems]
        alike = check_alike({name: one.made_with for name, one in checked.items()})
        return [*check_root(root, choice.layout, folders), *alike, *lines]


@dataclass(frozen=True)
class ConvertData(PublishedData):
    """Convert a published data set, or pack built-in scenes, into one memory-mapped store.

    Run it again to go on.
    """

    out: Path = Path("out/store")
    """Folder of the store; must not be there yet."""
    drop_bad: bool = False
    """Leave out states with odd keys or without numbers, instead of refusing their scene."""
    split: Literal["data1", "data2"] | None = None
    """How built-in scenes are split into train, validation and test."""

    def run_command(self) -> None:
        """Convert."""
        if rooms_in(self.folder):
            if self.split is None or self.layout or self.features or self.drop_bad:
                raise ValueError(
                    f"found built-in scenes in {self.folder}; say how to split them with --split "
                    "data1 or --split data2, and nothing but --out beside it"
                )
            head = pack(self.folder, self.split, self.out)
        else:
            root, folders, choice = self.contents(self.drop_bad)
            if self.split:
                raise ValueError(f"found --split {self.split} for {root}, but published data has "
                                 "splits of its own; leave it out")  # fmt: skip
            head = convert(root, folders, choice, self.out, self.processes)
        states = sum(s.states for s in head.scenes)
        print(f"{len(head.scenes)} scenes, {states} states in {self.out}")


@dataclass(frozen=True)
class EpisodesData:
    """Freeze published start states (pickle files) as JSON; nothing in them is run."""

    files: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Files such as kitchen_test_22.pkl, in the order of the episodes."""
    out: Path
    """JSON file of scene, state and goal of each episode."""
    first: int | None = None
    """Only so many episodes of each file; the published evaluations take 250."""

    def run_command(self) -> None:
        """Convert."""
        if not self.files or (self.first is not None and self.first < 1):
            raise ValueError("found no episodes to take; name at least one file and episode")
        episodes = [e for path in self.files for e in start_states.read_pickle(path)[: self.first]]
        start_states.write_episodes(self.out, episodes, self.files)
        print(f"{len(episodes)} episodes in {self.out}, {start_states.identity(episodes)[:16]}")


@dataclass(frozen=True)
class FreezeData:
    """Draw episodes from scenes and freeze them in a file with a hash (needs torch)."""

    scenes: Annotated[Path, tyro.conf.Positional]
    """Folder of scenes, or a store."""
    out: Path
    """JSON file of scene, state and goal of each episode."""
    rooms: Rooms = ()
    """TYPE:FIRST-LAST or data2:test; names or splits of a store; every scene when absent."""
    episodes: int = 1000
    """Number of episodes."""
    seed: int = 0
    """Draws starts and goals."""

    def run_command(self) -> None:
        """Draw and write."""
        from cfnav_core.learn.env import SceneBank
        from cfnav_core.learn.evaluate import Episodes

        if self.episodes < 1:
            raise ValueError(f"found --episodes {self.episodes}, expected at least 1")
        bank = SceneBank.load(self.scenes, self.rooms)
        starts = Episodes.draw(bank, self.episodes, self.seed).freeze(bank)
        start_states.write_episodes(self.out, starts, ())
        print(f"{len(starts)} episodes in {self.out}, {start_states.identity(starts)[:16]}")
