"""``cfnav data knowledge``: what models know beforehand, from training scenes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from cfnav_core import words
from cfnav_core.agent.config import Rooms
from cfnav_core.scenes.scene import OfflineScene, SceneError
from cfnav_core.scenes.select import open_scenes
from cfnav_core.scenes.store import HEAD
from cfnav_core.words import glove

SHIPPED = "shipped"
WORDS = "words"


@dataclass(frozen=True)
class KnowledgeCommand:
    """Make what models know beforehand from training scenes: zones, layouts, words (needs torch).

    Name training rooms only: what validation and test rooms look like must stay unknown.
    """

    scenes: Annotated[Path, tyro.conf.Positional]
    """Folder of built-in scenes, or a store (cfnav data convert)."""
    out: Path
    """The file to write, for example out/knowledge.safetensors."""
    rooms: Rooms = ()
    """Training rooms, for example data2:train; of a store, names of scenes, its training
    split when absent."""
    words: str = SHIPPED
    """Word vectors: shipped, or a GloVe file (text, or HDF5 with one dataset for each class)."""
    adjacency: Path | None = None
    """Your own links between objects, C x C of 0 and 1 (.npy or text), instead of counting what is
    seen together."""
    text: str = ""
    """For AKGVP: features of a text encoder, a file with C rows (.npy or text); or words, which
    lets the word vectors stand for them, as where pictures are not CLIP's either."""
    seed: int = 0
    """Draws the first zones."""

    def run_command(self) -> None:
        """Make and write it, and say what it holds."""
        # a robot has no torch, so it is imported only here
        from cfnav_core.knowledge.files import KnowledgeHead, read_matrix, save_knowledge
        from cfnav_core.knowledge.make import make_knowledge

        scenes = training_scenes(self.scenes, self.rooms)
        objects = scenes[0].objects
        vectors = self._vectors(objects)
        text = vectors if self.text == WORDS else None
        if self.text not in ("", WORDS):
            text = read_matrix(Path(self.text), len(objects))
        links = read_matrix(self.adjacency, len(objects), square=True) if self.adjacency else None
        known = make_knowledge(scenes, vectors, self.seed, text, links)
        head = KnowledgeHead(objects, tuple(s.name for s in scenes), scenes[0].perception,
                             self.words, self.seed)  # fmt: skip
        save_knowledge(self.out, known, head)
        tables = ", ".join(f"{name} {table.shape}" for name, table in known.arrays().items())
        print(f"wrote {self.out} from {len(scenes)} scenes: {tables}")

    def _vectors(self, objects: Sequence[str]) -> np.ndarray:
        if self.words == SHIPPED:
            return words.vectors(objects)
        return glove.from_file(Path(self.words), objects)


def training_scenes(folder: Path, rooms: Sequence[str]) -> list[OfflineScene]:
    """Open the scenes to learn from.

    Args:
        folder: of built-in scenes, or a store.
        rooms: see ``scenes.select.scene_names``; of a store, its training split when there are
            none.

    Raises:
        SceneError: there are none, or one is missing or damaged.
    """
    if not rooms:
        if not (folder / HEAD).exists():
            raise SceneError("found no --rooms; name the training rooms, for example data2:train")
        rooms = ("train",)
    return open_scenes(folder, rooms)
