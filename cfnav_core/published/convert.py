"""A published data set as one store; goes on where an interrupted run stopped."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from tqdm import tqdm

from cfnav_core.files.whole import WriteError
from cfnav_core.published.reader import Choice, read_scene
from cfnav_core.published.workers import in_order
from cfnav_core.scenes.layouts import SceneFolder
from cfnav_core.scenes.scene import OfflineScene
from cfnav_core.scenes.store import StoreHead
from cfnav_core.scenes.store_writer import StoreWriter


def convert(
    root: Path, folders: Sequence[SceneFolder], choice: Choice, out: Path, processes: int = 1
) -> StoreHead:
    """Read scenes in several processes and append them to a store in order.

    Args:
        root: folder of the scenes.
        folders: those to read.
        choice: what to read of them.
        out: folder of the store; must not be there yet.
        processes: each holds one scene in memory.

    Returns:
        The head of the finished store.

    Raises:
        SceneError: a scene cannot be read (those before it are kept for the next run), the disk
            is full, or the store is there already.
    """
    features = choice.features or "its first features"
    dropped = ", bad states dropped" if choice.drop_bad else ""
    made_from = f"{choice.layout.name}, {features}{dropped}"
    writer = StoreWriter(out, choice.layout.name, made_from, root)
    there = set(writer.head.names())
    todo = [f for f in folders if f.name not in there]
    parts = writer.partial / "scenes"
    shutil.rmtree(parts, ignore_errors=True)
    done = in_order(partial(_read_part, choice=choice, parts=parts), todo, processes)
    bar = tqdm(done, total=len(folders), initial=len(there), unit="scene", mininterval=1.0)
    try:
        for folder, part in bar:
            writer.append(OfflineScene.load(part), folder.split)
            shutil.rmtree(part)
    except WriteError:
        raise  # of a part, which names itself
    except OSError as error:
        raise writer.full(error) from error
    finally:
        done.close()
        shutil.rmtree(parts, ignore_errors=True)
    writer.finish()
    return writer.head


def _read_part(folder: SceneFolder, choice: Choice, parts: Path) -> Path:
    """One scene, on the disk: through a pipe its features would be copied twice."""
    part = parts / folder.name
    read_scene(folder, choice).save(part)
    return part
