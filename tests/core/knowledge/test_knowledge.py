"""Knowledge from small scenes, against counts done by hand, and its file."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from cfnav_core.knowledge.command import KnowledgeCommand
from cfnav_core.knowledge.files import (
    KnowledgeError,
    KnowledgeHead,
    load_head,
    load_knowledge,
    read_matrix,
    save_knowledge,
)
from cfnav_core.knowledge.make import detected, make_knowledge
from cfnav_core.knowledge.together import adjacency, layout_prior, pair_counts, parent_rewards
from cfnav_core.models.base import Knowledge
from cfnav_core.scenes.scene import OfflineScene, SceneError
from cfnav_core.scenes.store_writer import StoreWriter
from cfnav_core.task.detections import BOXES, SCORES, fields_before_names
from cfnav_core.task.vocabulary import ROOM_TYPES

OBJECTS = ("Mug", "Sink", "Fridge", "Spatula")
C = len(OBJECTS)
KITCHEN, BEDROOM = ROOM_TYPES.index("kitchen"), ROOM_TYPES.index("bedroom")


def scene(
    seen: list[list[int]], name: str = "kitchen:0", near: list[list[int]] | None = None,
    width: int = 5,
) -> OfflineScene:  # fmt: skip
    """One state a row of ``seen``, a quarter of a metre apart; all that is seen is near by default.

    Detections are a third column of noise beside the score that the width asks for.
    """
    shows = np.array(seen, bool)
    states = len(shows)
    detections = np.full((states, C, width), 0.25, np.float16)
    if width:
        detections[..., 516 if width == 517 else 0] = shows * 0.75
    index = np.arange(states, dtype=np.int32)
    return OfflineScene(
        name=name, room_type=name.split(":")[0], perception="eyes", source="hand",
        objects=OBJECTS, goals=("Mug",), features=np.zeros((states, 2), np.float16),
        detections=detections, next_state=np.repeat(index[:, None], 6, 1),
        collided=np.zeros(states, bool), visible=shows if near is None else np.array(near, bool),
        position=index, heading=np.zeros(states, np.int8), horizon=np.zeros(states, np.int8),
        positions=np.stack([index / 4, index * 0], 1).astype(np.float32),
        instances=np.ones(C, np.int16), distance=np.zeros((states, C), np.float32),
        fields=fields_before_names(width),
    )  # fmt: skip


def test_pairs_and_layout_prior():
    pairs = pair_counts(np.array([[1, 1, 0, 0], [1, 1, 1, 0], [1, 0, 0, 0]], bool))
    assert pairs.tolist() == [[3, 2, 1, 0], [2, 2, 1, 0], [1, 1, 1, 0], [0, 0, 0, 0]]
    prior = layout_prior(pairs)
    assert prior.dtype == np.float32
    assert prior.tolist() == [[0, 3, 2, 1], [3, 0, 2, 1], [2, 2, 0, 1], [1, 1, 1, 0]]


def test_links_go_one_way_from_rare_to_common():
    pairs = np.array([[200, 8, 5, 4], [8, 10, 0, 4], [5, 0, 5, 0], [4, 4, 0, 4]], float)
    # 8 of 200 is too small a share, 8 of 10 is not; 5 of 5 are just enough states, 4 of 4 too few
    assert adjacency(pairs).tolist() == [[0, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0]]


def test_parents_are_the_three_large_objects_most_often_near():
    objects = ("Mug", "Sink", "Fridge", "Chair", "Microwave", "Spatula")
    pairs = np.zeros((6, 6))
    pairs[0] = 90, 40, 30, 20, 10, 50  # a spatula is no large object, a mug not its own parent
    pairs[1, :3] = 40, 60, 7
    pairs[2, 1] = 7
    found = parent_rewards(pairs, objects, {"Mug", "Sink"})
    np.testing.assert_allclose(found[0], [0, 0.2, 0.15, 0.1, 0, 0])
    np.testing.assert_allclose(found[1], [0, 0, 0.5, 0, 0, 0])
    assert not found[2:].any(), "only what is asked for has parents"
    assert found.dtype == np.float32


@pytest.mark.parametrize("width", [5, 517, 4])
def test_detected_reads_every_known_table(width):
    seen = [[1, 0, 0, 1], [0, 1, 0, 0]]
    np.testing.assert_array_equal(
        detected((there := scene(seen, width=width)).detections, there.fields), seen
    )


def test_weak_scores_are_no_detections():
    table = np.array([0.5, 0.51, 0.0], np.float16)[None, :, None]
    assert detected(np.repeat(table, 5, 2), SCORES).tolist() == [[False, True, False]]
    assert detected(np.repeat(table, 517, 2), BOXES).tolist() == [[True, True, False]]


KITCHENS = [[1, 1, 0, 0], [1, 0, 1, 0], [0, 0, 0, 1], [1, 1, 0, 0]]


def test_knowledge_of_two_kitchens():
    words = np.ones((C, 3), np.float32)
    scenes = [scene(KITCHENS), scene(KITCHENS[:2], "kitchen:1")]
    known = make_knowledge(scenes, words, seed=0)
    assert known.words is words
    assert known.text is None
    np.testing.assert_array_equal(
        known.layout[KITCHEN], [[0, 4, 3, 1], [4, 0, 1, 1], [3, 1, 0, 1], [1, 1, 1, 0]]
    )
    np.testing.assert_array_equal(known.layout[BEDROOM], 1 - np.eye(C))
    # of the five states that show the mug, three show the sink and two the fridge
    np.testing.assert_allclose(known.parents[KITCHEN, 0], [0, 0.3, 0.2, 0])
    assert not known.parents[BEDROOM].any()
    assert known.zones.shape == (4, 8, C)
    assert set(np.unique(known.zones[KITCHEN])) <= {0, 0.5, 1}
    assert known.zone_edges.shape == (4, 8, 8)
    assert all(table.dtype == np.float32 for table in known.arrays().values())
    again = make_knowledge(scenes, words, seed=0)
    assert all((again.arrays()[k] == v).all() for k, v in known.arrays().items())


def test_zones_follow_detections_and_parents_what_is_near():
    far = np.zeros((4, C), int)
    known = make_knowledge([scene(KITCHENS, near=far.tolist())], None, seed=0)
    assert not known.parents.any()
    assert not known.adjacency.any()
    assert known.zones[KITCHEN].any()
    assert known.layout[KITCHEN].max() == 3


def test_scenes_without_detections_give_the_rest():
    known = make_knowledge([scene(KITCHENS, width=0)], None, seed=0)
    assert set(known.arrays()) == {"adjacency", "parents"}


def test_own_links_replace_counting():
    links = np.eye(C, dtype=np.float32)
    assert make_knowledge([scene(KITCHENS)], None, 0, links=links).adjacency is links


def test_scenes_that_do_not_go_together():
    one = scene(KITCHENS)
    for other in (replace(one, perception="others"), replace(one, objects=OBJECTS[::-1])):
        with pytest.raises(SceneError, match="make all of them with the same one"):
            make_knowledge([one, other], None, 0)
    with pytest.raises(SceneError, match="found no scenes"):
        make_knowledge([], None, 0)


def saved(path: Path) -> Knowledge:
    known = make_knowledge([scene(KITCHENS)], np.ones((C, 3), np.float32), 0)
    save_knowledge(path, known, KnowledgeHead(OBJECTS, ("kitchen:0",), "eyes", "ones", 0))
    return known


def test_file_comes_back(tmp_path):
    path = tmp_path / "new" / "k.safetensors"
    known = saved(path)
    again = load_knowledge(path, OBJECTS, "eyes")
    assert set(again.arrays()) == set(known.arrays())
    for name, table in known.arrays().items():
        np.testing.assert_array_equal(again.arrays()[name], table)
    assert load_head(path) == KnowledgeHead(OBJECTS, ("kitchen:0",), "eyes", "ones", 0)
    assert [p.name for p in path.parent.iterdir()] == ["k.safetensors"]


def test_knowledge_is_made_from_rooms_that_train(tmp_path):
    saved(tmp_path / "k.safetensors")
    load_knowledge(tmp_path / "k.safetensors", OBJECTS, "eyes", ["kitchen:0", "kitchen:1"])
    with pytest.raises(KnowledgeError, match="made from kitchen:0 and 0 more that do not train"):
        load_knowledge(tmp_path / "k.safetensors", OBJECTS, "eyes", ["kitchen:1"])


@pytest.mark.parametrize(
    ("objects", "perception", "message"),
    [
        ((*OBJECTS, "Bowl", "Pan"), "eyes", "4 objects without the scenes' Bowl, Pan"),
        (OBJECTS[:2], "eyes", "Fridge, Spatula, which the scenes do not have"),
        (OBJECTS[::-1], "eyes", "the scenes' objects in another order"),
        (OBJECTS, "others", "of perception eyes, but the scenes have others"),
    ],
)
def test_file_of_other_scenes_is_refused(tmp_path, objects, perception, message):
    saved(tmp_path / "k.safetensors")
    with pytest.raises(KnowledgeError, match=message):
        load_knowledge(tmp_path / "k.safetensors", objects, perception)


def rewrite(path: Path, head: dict | None = None, **tables: np.ndarray) -> None:
    text = {"schema": 1, "objects": OBJECTS, "scenes": [], "perception": "eyes", "words": "",
            "seed": 0} | (head or {})  # fmt: skip
    save_file({**load_file(path), **tables}, path, {"head": json.dumps(text)})


def test_damaged_files(tmp_path):
    path = tmp_path / "k.safetensors"

    def refused(message: str) -> None:
        with pytest.raises(KnowledgeError, match=message):
            load_knowledge(path, OBJECTS, "eyes")

    refused("found no readable knowledge")
    saved(path)
    path.write_bytes(path.read_bytes()[:-4])
    refused("found no readable knowledge")
    saved(path)
    rewrite(path, {"schema": 7})
    refused("found knowledge of schema 7 .* expected 1")
    rewrite(path, {"colour": "blue"})
    refused("found no readable knowledge")
    rewrite(path, layout=np.ones((4, C, C + 1), np.float32))
    refused(r"found layout of shape \(4, 4, 5\) .* expected \(4, 4, 4\)")
    saved(path)
    rewrite(path, zone_edges=np.ones((4, 3, 3), np.float32))
    refused(r"found zone")
    saved(path)
    rewrite(path, words=np.full((C, 3), np.nan, np.float32))
    refused("found numbers in words .* not finite")
    rewrite(path, colours=np.ones(3, np.float32), words=np.ones((C, 3), np.float32))
    refused("found unknown tables colours")


def test_own_matrices(tmp_path):
    expected = [[0, 1], [1, 0]]
    np.save(tmp_path / "a.npy", np.array(expected))
    (tmp_path / "a.txt").write_text("0 1\n1 0\n")
    (tmp_path / "a.csv").write_text("0, 1\n1,0\n")
    for path in sorted(tmp_path.iterdir()):
        found = read_matrix(path, 2, square=True)
        assert found.dtype == np.float32
        assert found.tolist() == expected
    (tmp_path / "text.csv").write_text("0.5,1,2\n3,4,5\n")
    assert read_matrix(tmp_path / "text.csv", 2).tolist() == [[0.5, 1, 2], [3, 4, 5]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0 1\n1 0\n0 0\n", r"found a matrix of shape \(3, 2\) in .* expected \(2, 2\)"),
        ("0 1\n1 0.5\n", "only 0 and 1"),
        ("0 1\n1 nan\n", "only 0 and 1"),
        ("0 1\n1\n", "found no readable matrix"),
        ("Mug Sink\n", "found no readable matrix"),
    ],
)
def test_bad_matrices(tmp_path, text, message):
    (tmp_path / "a.txt").write_text(text)
    with pytest.raises(KnowledgeError, match=message):
        read_matrix(tmp_path / "a.txt", 2, square=True)


def test_matrix_files_with_objects_are_not_unpickled(tmp_path):
    np.save(tmp_path / "a.npy", np.array([[None, 1], [1, None]], object), allow_pickle=True)
    with pytest.raises(KnowledgeError, match="found no readable matrix"):
        read_matrix(tmp_path / "a.npy", 2)


def test_command_over_a_folder_of_rooms(tmp_path, capsys):
    for seed in (0, 1, 2):
        scene(KITCHENS, f"kitchen:{seed}").save(tmp_path / "rooms" / f"kitchen_{seed:05d}")
    links, out = tmp_path / "links.txt", tmp_path / "k.safetensors"
    links.write_text("0 1 0 0\n" * C)
    KnowledgeCommand(
        scenes=tmp_path / "rooms", out=out, rooms=("kitchen:0-1",), adjacency=links, text="words"
    ).run_command()
    known = load_knowledge(out, OBJECTS, "eyes")
    np.testing.assert_array_equal(known.text, known.words)
    assert known.words.shape == (C, 384)
    assert known.adjacency[:, 1].all()
    assert known.layout[KITCHEN, 0, 1] == 1 + 2 * 2
    assert load_head(out).scenes == ("kitchen:0", "kitchen:1")
    printed = capsys.readouterr().out
    assert "2 scenes" in printed
    assert "zones (4, 8, 4)" in printed


def test_command_over_a_store_takes_its_training_split(tmp_path):
    writer = StoreWriter(tmp_path / "store", "data1", "by hand", tmp_path)
    for seed, split in enumerate(("train", "validation", "train", "test")):
        writer.append(scene(KITCHENS[seed:], f"kitchen:{seed}"), split)
    writer.finish()
    command = KnowledgeCommand(scenes=tmp_path / "store", out=tmp_path / "k.safetensors")
    command.run_command()
    assert load_head(command.out).scenes == ("kitchen:0", "kitchen:2")
    replace(command, rooms=("kitchen:1",)).run_command()
    assert load_head(command.out).scenes == ("kitchen:1",)


def test_command_needs_to_know_the_training_rooms(tmp_path):
    scene(KITCHENS).save(tmp_path / "kitchen_00000")
    with pytest.raises(SceneError, match="found no --rooms"):
        KnowledgeCommand(scenes=tmp_path, out=tmp_path / "k.safetensors").run_command()
