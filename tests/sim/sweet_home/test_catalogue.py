"""The catalogues: what is read, and what is said where something is missing or damaged."""

import zipfile

import pytest
from sim_bridge.sweet_home.catalogue import (
    ARCHIVES,
    PROPERTIES,
    UPRIGHT,
    SweetHomeError,
    catalogue,
    read_properties,
)


def test_an_entry_has_metres_and_where_its_model_is(furnish):
    turn = "1 0 0 0 0 1 0 -1 0"
    folder = furnish(
        {}, {"id": "Test#shelf", "dropOnTopElevation": "-1", "elevation": "150"},
        {"id": "Test#seat", "dropOnTopElevation": "12.5", "modelRotation": turn, "creator": ""},
    )  # fmt: skip
    found = catalogue()
    assert list(found) == ["Test#board", "Test#shelf", "Test#seat"]
    board, shelf, seat = found.values()
    assert (board.name, board.category, board.creator) == ("Board", "Office", "Somebody")
    assert board.size == (0.4, 0.04, 0.2)
    assert (board.elevation, board.drop_on_top, board.rotation) == (0, 0.2, UPRIGHT)
    assert (board.archive, board.model) == (folder / f"{ARCHIVES[0]}.sh3f", "test/board.obj")
    assert board.licence == "None at all"
    assert (shelf.elevation, shelf.drop_on_top) == (1.5, None)
    assert (seat.drop_on_top, seat.creator) == (0.125, "")
    assert seat.rotation == ((1, 0, 0), (0, 0, 1), (0, -1, 0))


def test_properties_as_java_writes_them():
    text = "# no\n! no\na#1 = b = c\nb:d\\\n   e\\u00e9\\:f\r\n\nodd#-1\nc=\n"
    assert read_properties(text) == {"a#1": "b = c", "b": "deé:f", "c": ""}


def test_a_missing_package_is_one_sentence(tmp_path, monkeypatch):
    monkeypatch.setenv("CFNAV_SWEET_HOME", str(tmp_path / "none"))
    with pytest.raises(SweetHomeError) as error:
        catalogue()
    assert str(error.value) == (
        f"found no BlendSwap-CC-0.sh3f, BlendSwap-CC-BY.sh3f, KatorLegaz.sh3f, Scopia.sh3f in "
        f"{tmp_path}/none; install them with 'apt install sweethome3d-furniture', or unpack that "
        "package and set CFNAV_SWEET_HOME to its folder of .sh3f files; rooms such as "
        "cc0.kitchen:25 need neither"
    )


@pytest.mark.parametrize("content", [b"no zip", b""])
def test_a_damaged_archive_is_one_sentence(furnish, content):
    (furnish() / "Scopia.sh3f").write_bytes(content)
    with pytest.raises(SweetHomeError, match=r"found .*Scopia\.sh3f damaged \(File is not a zip"):
        catalogue()


def test_an_archive_cut_or_changed_is_one_sentence(furnish):
    path = furnish() / "BlendSwap-CC-0.sh3f"
    path.write_bytes(path.read_bytes().replace(b"made by a test", b"made by a TEST"))
    with pytest.raises(SweetHomeError, match=r"damaged .*Bad CRC"):
        catalogue()
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("other", "")
    with pytest.raises(SweetHomeError, match=f"damaged .*{PROPERTIES}"):
        catalogue()


@pytest.mark.parametrize(
    "field",
    [{"width": "wide"}, {"depth": "0"}, {"modelRotation": "1 0 0"}, {"height": "nan"}],
)
def test_a_damaged_entry_is_one_sentence(furnish, field):
    furnish(field)
    with pytest.raises(SweetHomeError, match=r"found Test#board damaged in .*; install") as error:
        catalogue()
    assert "\n" not in str(error.value)
