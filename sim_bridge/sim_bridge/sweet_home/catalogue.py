"""What furniture there is: the catalogues inside the archives of sweethome3d-furniture.

Each archive (``.sh3f``) is a zip with a Java properties file that gives every model's real size.
Read are the four archives of things in rooms, not the one of people; or the one that comes with
cfnav, of the few models that are in the public domain.
"""

from __future__ import annotations

import math
import os
import re
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

ARCHIVES = ("BlendSwap-CC-0", "BlendSwap-CC-BY", "KatorLegaz", "Scopia")
FOLDER = Path("/usr/share/sweethome3d/furniture")
"""Where the Debian package puts its archives."""
VARIABLE = "CFNAV_SWEET_HOME"
"""Environment variable that names another folder of archives."""
SHIPPED = Path(__file__).parent / "cc0/models.sh3f"
"""What comes with cfnav; ``sim_bridge.data.ship_models`` makes it."""

PROPERTIES = "PluginFurnitureCatalog.properties"

Rotation = tuple[tuple[float, ...], ...]
UPRIGHT: Rotation = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class SweetHomeError(ValueError):
    """The furniture is missing, damaged or of no use; the message is one sentence."""


@dataclass(frozen=True)
class Entry:
    """One model of a catalogue, not yet read.

    Attributes:
        id: unique, such as "Blend Swap CC-0#armchair"; names repeat.
        name: in English, as people would call it.
        category: the catalogue's, such as "Living room".
        size: width, depth and height, metres.
        elevation: of its bottom above the floor, metres.
        drop_on_top: height above its bottom at which things stand on it, metres; None when nothing
            can.
        rotation: 3x3, turns the file's vertices (x right, y up, z to the viewer) upright.
        creator: who made it; "" where the catalogue does not say.
        licence: under which, in the catalogue's words.
        archive: the zip.
        model: path of the OBJ file inside it.
    """

    id: str
    name: str
    category: str
    size: tuple[float, float, float]
    elevation: float
    drop_on_top: float | None
    rotation: Rotation
    creator: str
    licence: str
    archive: Path
    model: str


def furniture_folder() -> Path:
    """Where the archives are: named by ``CFNAV_SWEET_HOME``, else the Debian package's folder."""
    named = os.environ.get(VARIABLE)
    return Path(named) if named else FOLDER


def catalogue(folder: Path | None = None) -> dict[str, Entry]:
    """Read what furniture there is; models themselves stay unread.

    Args:
        folder: of the archives; ``furniture_folder()`` when None.

    Returns:
        Entries by id, in the order of the catalogues.

    Raises:
        SweetHomeError: an archive is missing or damaged.
    """
    folder = folder or furniture_folder()
    paths = [folder / f"{name}.sh3f" for name in ARCHIVES]
    absent = [path.name for path in paths if not path.exists()]
    if absent:
        raise SweetHomeError(
            f"found no {', '.join(absent)} in {folder}; install them with 'apt install "
            f"sweethome3d-furniture', or unpack that package and set {VARIABLE} to its folder of "
            ".sh3f files; rooms such as cc0.kitchen:25 need neither"
        )
    return {entry.id: entry for path in paths for entry in _entries(path)}


def shipped() -> dict[str, Entry]:
    """Read what furniture comes with cfnav: entries by id.

    Raises:
        SweetHomeError: the archive is missing or damaged.
    """
    return {entry.id: entry for entry in _entries(SHIPPED)}


def package_of(archive: Path) -> str:
    """What has to be installed again where an archive is damaged."""
    return "cfnav" if archive == SHIPPED else "sweethome3d-furniture"


def _entries(archive: Path) -> list[Entry]:
    try:
        with zipfile.ZipFile(archive) as file:
            text = file.read(PROPERTIES).decode("latin-1")
    except (OSError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise SweetHomeError(
            f"found {archive} damaged ({error}); install {package_of(archive)} again"
        ) from error
    rows: dict[str, dict[str, str]] = {}
    for key, value in read_properties(text).items():
        field, _, number = key.partition("#")
        rows.setdefault(number, {})[field] = value
    licence = rows.pop("", {}).get("license", "")
    return [_entry(row, licence, archive) for row in rows.values() if "model" in row]


def read_properties(text: str) -> dict[str, str]:
    """Read a Java properties file, with its comments, escapes and lines that go on in the next."""
    text = re.sub(r"\\\r?\n[ \t]*", "", text)
    pairs = re.findall(r"^[ \t]*([^#!\s=:][^\s=:]*)[ \t]*[=:][ \t]*(.*?)[ \t]*\r?$", text, re.M)
    return {key: _unescaped(value) for key, value in pairs}


def _unescaped(value: str) -> str:
    return re.sub(r"\\u([0-9a-fA-F]{4})|\\(.)", lambda m: chr(int(m[1], 16)) if m[1] else m[2],
                  value)  # fmt: skip


def _metres(centimetres: str) -> float:
    metres = round(float(centimetres) / 100, 6)
    if not math.isfinite(metres):
        raise ValueError(f"{centimetres} is no length")
    return metres


def _entry(row: Mapping[str, str], licence: str, archive: Path) -> Entry:
    name = row.get("id", row["model"])
    try:
        width, depth, height = (_metres(row[side]) for side in ("width", "depth", "height"))
        top = _metres(row["dropOnTopElevation"]) if "dropOnTopElevation" in row else height
        turn = [float(number) for number in row.get("modelRotation", "").split()]
        if not min(width, depth, height) > 0 or len(turn) not in (0, 9):
            raise ValueError("it has no size or no 3x3 rotation")
        return Entry(
            row["id"], row["name"], row.get("category", ""), (width, depth, height),
            _metres(row.get("elevation", "0")), top if top >= 0 else None,
            tuple(tuple(turn[i : i + 3]) for i in (0, 3, 6)) if turn else UPRIGHT,
            row.get("creator", ""), row.get("license", licence), archive, row["model"].lstrip("/"),
        )  # fmt: skip
    except (KeyError, ValueError) as error:
        raise SweetHomeError(
            f"found {name} damaged in {archive} ({type(error).__name__}: {error}); install "
            f"{package_of(archive)} again"
        ) from error
