"""Mends the ROS wheels' CMake files: they name the header folders of the wheels' builder.

Packages of interfaces then build against the wheels. Mending again changes nothing.
"""

from __future__ import annotations

import re
from pathlib import Path

from steps import SetupError

BUILDER = "/opt/python/"
NUMPY_HEADERS = re.compile(r"/opt/python/cp[^/;\"]+/lib/[^;\">\s]*?/numpy/_?core/include")
PYTHON_HEADERS = re.compile(r"/opt/python/cp[^/;\"]+/include/python[0-9.]+")


def mend(share: Path, python_headers: str, numpy_headers: str) -> None:
    """Puts this machine's header folders in place of the builder's in every CMake file.

    Args:
        share: The `share` folder of the virtual environment.
        python_headers: Folder with Python.h.
        numpy_headers: Folder with numpy/ndarrayobject.h.

    Raises:
        SetupError: A file names a folder of the builder that this module does not know.
    """
    for path in sorted(share.glob("*/cmake/*.cmake")):
        text = path.read_text()
        mended = PYTHON_HEADERS.sub(python_headers, NUMPY_HEADERS.sub(numpy_headers, text))
        if BUILDER in mended:
            found = mended[mended.index(BUILDER) :].split("\n", 1)[0][:120]
            raise SetupError(
                f"{path} still names a folder of the wheels' builder ({found}): the wheels have "
                "changed and scripts/mend_wheels.py must learn this path."
            )
        if mended != text:
            # A new file in its place: the old one may be a hard link into uv's cache.
            temporary = path.with_suffix(".partial")
            temporary.write_text(mended)
            temporary.replace(path)
