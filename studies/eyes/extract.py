"""Pictures out of packages: members of archives, and pictures that other files hold.

``Picture.inside`` says where in a member: ``cell 30 output 0`` of a notebook, the path within a Qt
resource file (``.rcc``), ``640x480 at 4986210`` for raw pixels, blue first, in an MRPT rawlog.
"""

from __future__ import annotations

import base64
import gzip
import io
import json
import re
import struct
import subprocess
import tarfile
import zipfile
import zlib
from pathlib import Path, PurePosixPath

import numpy as np


def extract(package: Path, path: str, inside: str) -> bytes:
    """Bytes of one picture as a picture file.

    Raises:
        ValueError: the package holds no such picture.
    """
    try:
        content = _member(package, path)
        if not inside:
            return content
        return HOLDERS[PurePosixPath(path).suffix](content, inside)
    except (OSError, KeyError, IndexError, ValueError, struct.error, zlib.error) as error:
        raise ValueError(f"found no {inside or 'picture'} at {path} in {package.name}") from error


def _member(package: Path, path: str) -> bytes:
    if package.suffix in {".whl", ".zip"}:
        with zipfile.ZipFile(package) as archive:
            return archive.read(path)
    if package.suffix == ".deb":
        command = ["dpkg-deb", "--fsys-tarfile", str(package)]
        done = subprocess.run(command, capture_output=True, check=False)
        with tarfile.open(fileobj=io.BytesIO(done.stdout)) as archive:
            return _read(archive, f"./{path}")
    with tarfile.open(package) as archive:
        return _read(archive, path)


def _read(archive: tarfile.TarFile, path: str) -> bytes:
    file = archive.extractfile(path)
    if file is None:
        raise KeyError(path)
    return file.read()


def of_notebook(content: bytes, inside: str) -> bytes:
    """The picture that a cell of a Jupyter notebook gave."""
    _, cell, _, output = inside.split()
    data = json.loads(content)["cells"][int(cell)]["outputs"][int(output)]["data"]
    text = data["image/png"]
    return base64.b64decode(text if isinstance(text, str) else "".join(text))


def of_rawlog(content: bytes, inside: str) -> bytes:
    """Raw pixels of a rawlog as a PPM file."""
    wide, high, at = map(int, re.findall(r"\d+", inside))
    pixels = np.frombuffer(gzip.decompress(content), np.uint8, wide * high * 3, at)
    return b"P6 %d %d 255\n" % (wide, high) + pixels.reshape(-1, 3)[:, ::-1].tobytes()


def of_resource(content: bytes, inside: str) -> bytes:
    """A file of a Qt resource file, stored or compressed by zlib."""
    version, tree, data, names = struct.unpack(">IIII", content[4:20])
    size = 22 if version >= 2 else 14

    def name(node: int) -> str:
        at = names + struct.unpack_from(">I", content, tree + node * size)[0]
        length = struct.unpack_from(">H", content, at)[0]
        return content[at + 6 : at + 6 + 2 * length].decode("utf-16-be")

    node = 0
    for word in inside.split("/"):
        count, first = struct.unpack_from(">II", content, tree + node * size + 6)
        node = {name(n): n for n in range(first, first + count)}[word]
    flags = struct.unpack_from(">H", content, tree + node * size + 4)[0]
    at = data + struct.unpack_from(">I", content, tree + node * size + 10)[0]
    length = struct.unpack_from(">I", content, at)[0]
    stored = content[at + 4 : at + 4 + length]
    return zlib.decompress(stored[4:]) if flags & 1 else stored


HOLDERS = {".ipynb": of_notebook, ".rcc": of_resource, ".rawlog": of_rawlog}
