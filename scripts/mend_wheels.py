"""Mends the ROS wheels' CMake files: they name the header folders of the wheels' builder.

Run it with the Python of the virtual environment: `.venv/bin/python scripts/mend_wheels.py`.
Packages of interfaces then build against the wheels. Running it again changes nothing.
"""

from __future__ import annotations

import re
import sys
import sysconfig
from pathlib import Path

BUILDER = "/opt/python/"
NUMPY_HEADERS = re.compile(r"/opt/python/cp[^/;\"]+/lib/[^;\">\s]*?/numpy/_?core/include")
PYTHON_HEADERS = re.compile(r"/opt/python/cp[^/;\"]+/include/python[0-9.]+")


def mend_text(text: str, python_headers: str, numpy_headers: str) -> str:
    """Puts this machine's header folders in place of the builder's.

    Args:
        text: A CMake file.
        python_headers: Folder with Python.h.
        numpy_headers: Folder with numpy/ndarrayobject.h.

    Returns:
        The text, mended; the same text when it names no folder of the builder.
    """
    return PYTHON_HEADERS.sub(python_headers, NUMPY_HEADERS.sub(numpy_headers, text))


def mend_files(share: Path, python_headers: str, numpy_headers: str) -> int:
    """Mends every CMake file of the installed ROS packages.

    Args:
        share: The `share` folder of the virtual environment.
        python_headers: Folder with Python.h.
        numpy_headers: Folder with numpy/ndarrayobject.h.

    Returns:
        Number of files changed.

    Raises:
        ValueError: A file names a folder of the builder that this module does not know.
    """
    changed = 0
    for path in sorted(share.glob("*/cmake/*.cmake")):
        text = path.read_text()
        mended = mend_text(text, python_headers, numpy_headers)
        if BUILDER in mended:
            found = mended[mended.index(BUILDER) :].split("\n", 1)[0][:120]
            raise ValueError(
                f"{path} still names a folder of the wheels' builder ({found}): the wheels have "
                "changed and scripts/mend_wheels.py must learn this path."
            )
        if mended != text:
            temporary = path.with_suffix(".partial")
            temporary.write_text(mended)
            temporary.replace(path)
            changed += 1
    return changed


def main() -> int:
    """Mends the wheels of the running virtual environment."""
    import numpy

    try:
        changed = mend_files(
            Path(sys.prefix, "share"), sysconfig.get_path("include"), numpy.get_include()
        )
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    print(f"mended {changed} CMake files")
    return 0


if __name__ == "__main__":
    sys.exit(main())
