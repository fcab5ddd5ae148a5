"""Licences and credits, and the command that ships models and writes whom to name."""

from __future__ import annotations

import zipfile

import pytest
import yaml
from sim_bridge.data.ship_models import ShipOptions
from sim_bridge.sweet_home.catalogue import SweetHomeError, catalogue
from sim_bridge.sweet_home.licences import CC0, CC_BY, CC_BY_US, credit
from sim_bridge.sweet_home.table import VARIABLE

from tests.sim.sweet_home.conftest import board_files

WHOLE = "This file is under the\nCreative Commons Zero (Public Domain) license"
TEXT = (
    'Thank you for downloading "A Board" by Zoe\nReleased under\nCreative Commons Zero (Public '
    "Domain)\nDownloaded from http://www.blendswap.com/blends/view/123\n"
)
PAGE = (
    "<html><title>77 - Z&uuml;rich Set - Downloaded from Blend Swap</title>Released under <a>"
    "Creative Commons Attribution 3.0</a>. The author may violate a Creative Commons License."
)
OLDER = (
    "<title>\n\tChair by cris - 76803 - Creative Commons License\n</title> under "
    "<h2>Creative Commons\n Zero</h2>"
)


@pytest.fixture
def boards(furnish):
    """Makes archives whose boards have some files of their own, by the boards' names."""

    def make(whole: str = WHOLE, **own: str) -> None:
        names = own or {"board": ""}
        files: dict[str, bytes | str] = {"LICENSE.TXT": whole}
        for name, text in names.items():
            beside = board_files()
            if text:
                suffix = "html" if "<title>" in text else "txt"
                beside[f"test/BLEND_LICENSE.{suffix}"] = text
            files |= {key.replace("test/", f"{name}/", 1): v for key, v in beside.items()}
        furnish(*({"id": f"Test#{name}", "model": f"/{name}/board.obj"} for name in names),
                files=files)  # fmt: skip

    return make


@pytest.mark.parametrize(
    ("text", "licence", "title", "source"),
    [
        (TEXT, CC0, "A Board", "https://www.blendswap.com/blends/view/123"),
        (PAGE, CC_BY, "Zürich Set", ""),
        (OLDER, CC0, "Chair", ""),
        (TEXT + PAGE, CC_BY, "A Board", "https://www.blendswap.com/blends/view/123"),
    ],
)
def test_what_lies_beside_a_model_counts_before_its_archive(boards, text, licence, title, source):
    boards(board=text)
    who = credit(catalogue()["Test#board"])
    assert (who.licence, who.title, who.source, who.own) == (licence, title, source, True)
    assert who.entry.creator == "Somebody"


@pytest.mark.parametrize(
    ("whole", "licence"),
    [
        (WHOLE, CC0),
        ("Creative Commons Attribution 3.0 Unported", CC_BY),
        ("Creative Commons Attribution 3.0 United\nStates", CC_BY_US),
    ],
)
def test_else_its_archive_says_it(boards, whole, licence):
    boards(whole)
    who = credit(catalogue()["Test#board"])
    assert (who.licence, who.title, who.source, who.own) == (licence, "Board", "", False)


def test_a_model_without_a_licence_is_one_sentence(boards):
    boards("All rights reserved")
    with pytest.raises(SweetHomeError, match=r"found no licence of Test#board in .*; leave it out"):
        credit(catalogue()["Test#board"])


def test_only_what_says_itself_that_it_is_free_is_shipped(boards, tmp_path, monkeypatch, capsys):
    boards(free=TEXT, named=PAGE, silent="")
    table = tmp_path / "models.yaml"
    rows = [{"id": f"Test#{name}"} for name in ("free", "named", "silent")]
    table.write_text(yaml.safe_dump({"sofa": rows, "left_out": {}}))
    monkeypatch.setenv(VARIABLE, str(table))
    out, page = tmp_path / "out", tmp_path / "credits.md"
    ShipOptions(out, page).run_command()
    assert capsys.readouterr().out.startswith(f"1 models of 3 in {out}, ")
    with zipfile.ZipFile(out / "models.sh3f") as archive:
        assert "free/free.obj" in archive.namelist()
        assert not {name for name in archive.namelist() if "named" in name or "silent" in name}
    last = (out / "NOTICE").read_text().splitlines()[-1]
    assert last == (
        'free: "A Board" by Somebody, CC0-1.0, https://www.blendswap.com/blends/view/123'
    )
    lines = page.read_text().splitlines()
    assert lines[-1] == "| Somebody | Zürich Set |"
    assert any(line.startswith("- 2 models from Blend Swap in the public domain") for line in lines)
