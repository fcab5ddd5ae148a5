"""What is written appears only when complete; a full disk is one sentence and changes nothing."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cfnav_core.files.json_file import write_json
from cfnav_core.files.whole import WriteError, whole
from cfnav_core.knowledge.files import KnowledgeHead, load_knowledge, save_knowledge
from cfnav_core.models.base import Knowledge
from cfnav_core.perception.picture_set import PictureSet
from cfnav_core.published.start_states import StartState, read_episodes, write_episodes
from cfnav_core.task.vocabulary import CATEGORIES
from tests.core.disks import AGAIN, full_disk

HEAD = KnowledgeHead(("Mug", "Sofa"), ("kitchen:0",), "test", "none", 0)


def figures(path, n):
    write_json(path, {"numbers": [0] * n})


def episodes(path, n):
    write_episodes(path, [StartState("FloorPlan1", "0.00|0.00|0|0", "Mug")] * n, ())


def knowledge(path, n):
    save_knowledge(path, Knowledge(words=np.ones((2, n), np.float32)), HEAD)


def pictures(path, n):
    PictureSet(
        np.zeros((n, 150, 150, 3), np.uint8),
        *(np.zeros((n, 19, 19, len(CATEGORIES)), np.uint8) for _ in range(2)),
        *(np.zeros((n, 10, 10), np.uint8) for _ in range(2)),
    ).save(path)  # fmt: skip


READ = {
    figures: lambda path: len(json.loads(path.read_text())["numbers"]),
    episodes: lambda path: len(read_episodes(path)),
    knowledge: lambda path: load_knowledge(path, HEAD.objects, "test").words.shape[1],
    pictures: lambda path: len(PictureSet.load(path).pictures),
}


@pytest.mark.parametrize("write", READ)
def test_a_full_disk_keeps_what_was_there(write, tmp_path):
    path = tmp_path / "new" / "out"
    with full_disk(100), pytest.raises(WriteError, match=AGAIN):
        write(path, 20)
    assert not list((tmp_path / "new").iterdir())
    write(path, 2)
    with full_disk(100), pytest.raises(WriteError, match=AGAIN) as said:
        write(path, 20)
    assert str(path) in str(said.value)
    assert [p.name for p in path.parent.iterdir()] == ["out"]
    assert READ[write](path) == 2
    write(path, 20)
    assert READ[write](path) == 20
    assert [p.name for p in path.parent.iterdir()] == ["out"]


def folder_of(path, text):
    path.mkdir()
    (path / "file").write_text(text)
    return path


def test_a_folder_is_whole_whenever_it_is_interrupted(tmp_path, monkeypatch):
    path, replace = folder_of(tmp_path / "out", "old"), Path.replace

    def interrupted(self, target):
        if self.suffix == ".partial":
            raise KeyboardInterrupt
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt), whole(path) as partial:
        folder_of(partial, "new")
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
    assert (path / "file").read_text() == "old"


@pytest.mark.parametrize("fails", [True, False])
def test_a_folder_that_stepped_aside_when_it_was_killed_comes_back(tmp_path, fails):
    path = tmp_path / "out"
    folder_of(tmp_path / ".out.before", "old")
    folder_of(tmp_path / "out.partial", "new")
    try:
        with whole(path) as partial:
            folder_of(partial, "newer")
            assert (path / "file").read_text() == "old"
            if fails:
                raise ValueError
    except ValueError:
        assert fails
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
    assert (path / "file").read_text() == ("old" if fails else "newer")


def test_what_a_user_keeps_beside_it_stays(tmp_path):
    folder_of(tmp_path / "out.old", "mine")
    (tmp_path / "figures.json.old").write_text("mine")
    with whole(tmp_path / "out") as partial:
        folder_of(partial, "new")
    figures(tmp_path / "figures.json", 2)
    names = {p.name for p in tmp_path.iterdir()}
    assert names == {"out", "out.old", "figures.json", "figures.json.old"}
    assert (tmp_path / "out.old" / "file").read_text() == "mine"
