"""How large the house is and whether its import rules hold: ``python -m studies.house``.

The last paragraph of a folder's docstring names the folders and the heavy libraries that it
``May import:``. A name stands for all that lies below it. ROS is imported only in folders named
``ros`` and in studies. ``tests/test_boundaries.py`` holds these rules with the code below.
"""

from __future__ import annotations

import ast
import io
import re
import subprocess
import sys
import tarfile
import tokenize
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import tyro

ROOT = Path(__file__).resolve().parent.parent

PACKAGES = {
    "cfnav": ROOT / "cfnav",
    "cfnav_core": ROOT / "cfnav_core",
    "cfnav_ros": ROOT / "cfnav_ros/cfnav_ros",
    "sim_bridge": ROOT / "sim_bridge/sim_bridge",
    "studies": ROOT / "studies",
}

HEAVY = {"torch", "mujoco", "gymnasium", "ray"}
"""Libraries that not everybody has: a folder that imports one says so."""

ROS = re.compile(r"rclpy|rosbag2_py|rosgraph_msgs|\w+_interfaces|\w+_msgs|std_srvs")

_LAYOUT = {
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE),
    *(tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER),
}
"""Kinds of tokens that make no line one of code."""


@dataclass(frozen=True)
class HouseConfig:
    """Print lines by folder, the largest files, and whether the import rules hold."""

    since: str = ""
    """Git revision to compare with: lines of each package then and now."""
    largest: int = 10
    """Number of the largest files to print."""


@dataclass(frozen=True)
class Size:
    """Lines of Python: ``code`` without docstrings, comments and empty lines."""

    files: int = 0
    code: int = 0
    lines: int = 0

    def __add__(self, other: Size) -> Size:
        return Size(self.files + other.files, self.code + other.code, self.lines + other.lines)


def modules() -> dict[str, Path]:
    """Dotted name of every module to its file; a folder goes by its own name."""
    found = {}
    for package, folder in PACKAGES.items():
        for path in sorted(folder.rglob("*.py")):
            if path.name != "setup.py":
                inside = path.relative_to(folder).with_suffix("").parts
                found[".".join([package, *(p for p in inside if p != "__init__")])] = path
    return found


MODULES = modules()
FOLDERS = {name: path for name, path in MODULES.items() if path.name == "__init__.py"}


def folder_of(name: str) -> str:
    """The folder in which a module lies; of a folder itself."""
    while name not in FOLDERS:
        name = name.rpartition(".")[0]
    return name


def rule(folder: str) -> list[str] | None:
    """What a folder may import; None when it has no rule of its own."""
    text = ast.get_docstring(ast.parse(FOLDERS[folder].read_text())) or ""
    _, found, names = text.partition("May import:")
    if not found:
        return None
    return [] if "nothing of" in names else re.findall(r"[\w.]*\w", names)


def imported(path: Path) -> set[str]:
    """Names of every import statement, also of those inside functions."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            inside = {f"{node.module}.{alias.name}" for alias in node.names}
            names |= {name for name in inside if name in MODULES} or {node.module}
    return names


def covers(allowed: str, name: str) -> bool:
    """Whether a name is the allowed one or lies below it."""
    return name == allowed or name.startswith(allowed + ".")


def speaks_ros(name: str) -> bool:
    """Whether a module may import ROS."""
    return ".ros." in f"{name}." or covers("studies", name)


def forbidden_imports(name: str) -> Iterator[str]:
    """A sentence for each import of a module that its folder does not allow."""
    folder = folder_of(name)
    allowed = rule(folder) or []
    for target in sorted(imported(MODULES[name])):
        top = target.split(".")[0]
        ours = top in PACKAGES and not covers(folder, target)
        if (ours or top in HEAVY) and not any(covers(a, target) for a in allowed):
            yield f"{name} imports {target}, which the docstring of {folder} does not allow"
        if ROS.fullmatch(top) and not speaks_ros(name):
            yield f"{name} imports {target}, and ROS stands in folders named ros"
        if top == "tests":
            yield f"{name} imports {target}, and tests are imported by tests alone"


def size_of(source: str) -> Size:
    """Count the lines of one file."""
    code: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in _LAYOUT:
            code |= set(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            docstring = isinstance(node.value.value, str)
            code -= set(range(node.lineno, (node.end_lineno or 0) + 1)) if docstring else set()
    return Size(1, len(code), len(source.splitlines()))


def package_of(path: str) -> str | None:
    """The package of a file, None of one that is no Python of a package."""
    for package, folder in PACKAGES.items():
        inside = path.startswith(f"{folder.relative_to(ROOT)}/")
        if inside and path.endswith(".py") and not path.endswith("setup.py"):
            return package
    return None


def sizes_at(revision: str) -> dict[str, Size]:
    """Lines of each package as they were at a git revision.

    Raises:
        ValueError: git does not know the revision; one sentence.
    """
    paths = [p for p in _git("ls-tree", "-r", "--name-only", revision).split("\n") if package_of(p)]
    files = _git_bytes("archive", "--format=tar", revision, "--", *paths)
    found = dict.fromkeys(PACKAGES, Size())
    with tarfile.open(fileobj=io.BytesIO(files)) as archive:
        for member in archive.getmembers():
            package, file = package_of(member.name), archive.extractfile(member)
            if package and file:
                found[package] += size_of(file.read().decode())
    return found


def came_from_tests(revision: str) -> set[Path]:
    """Files of the packages that git finds to be moved ones of tests/ at a revision."""
    moved = _git("diff", "--name-status", "-M40%", "-l0", "--diff-filter=R", revision)
    pairs = [line.split("\t")[1:] for line in moved.splitlines()]
    return {ROOT / new for old, new in pairs if old.startswith("tests/") and package_of(new)}


def _git(*arguments: str) -> str:
    return _git_bytes(*arguments).decode()


def _git_bytes(*arguments: str) -> bytes:
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, check=False)
    if done.returncode:
        raise ValueError(f"git {arguments[0]} failed: {done.stderr.decode().strip()}")
    return done.stdout


def _print_folders(sizes: Mapping[str, Size]) -> None:
    by_folder = dict.fromkeys(FOLDERS, Size())
    for name, size in sizes.items():
        by_folder[folder_of(name)] += size
    print(f"{'folder':32} {'files':>6} {'code':>8} {'lines':>8}")
    for folder, size in [*by_folder.items(), ("all", sum(sizes.values(), Size()))]:
        print(f"{folder:32} {size.files:6,} {size.code:8,} {size.lines:8,}")


def _print_since(revision: str, sizes: Mapping[str, Size]) -> None:
    """Then and now, package by package; what came over from tests/ counts on neither side."""
    before, left_out = sizes_at(revision), came_from_tests(revision)
    now = dict.fromkeys(PACKAGES, Size())
    for name, size in sizes.items():
        if MODULES[name] not in left_out:
            now[name.split(".")[0]] += size
    print(f"\nsince {revision}, without {len(left_out)} files that came from tests/")
    print(f"{'package':32} {'code':>8} {'now':>8} {'':>8} {'lines':>8} {'now':>8}")
    rows = [(name, before[name], now[name]) for name in PACKAGES]
    total = ("all", sum(before.values(), Size()), sum(now.values(), Size()))
    for name, was, size in [*rows, total]:
        print(
            f"{name:32} {was.code:8,} {size.code:8,} {size.code - was.code:+8,} "
            f"{was.lines:8,} {size.lines:8,} {size.lines - was.lines:+8,}"
        )


def main() -> None:
    """Run the command line: 0 when the import rules hold, 1 when not, 2 when git cannot answer."""
    config = tyro.cli(HouseConfig, prog="house")
    sizes = {name: size_of(path.read_text()) for name, path in MODULES.items()}
    _print_folders(sizes)
    print("\nlargest files")
    for name, lines in Counter({n: s.lines for n, s in sizes.items()}).most_common(config.largest):
        print(f"{lines:6,}  {MODULES[name].relative_to(ROOT)}")
    if config.since:
        try:
            _print_since(config.since, sizes)
        except ValueError as error:
            print(f"house: {error}", file=sys.stderr)
            sys.exit(2)
    broken = [sentence for name in MODULES for sentence in forbidden_imports(name)]
    print(f"\nimport rules: {'broken' if broken else 'held'}", *broken, sep="\n  ")
    sys.exit(1 if broken else 0)


if __name__ == "__main__":
    main()
