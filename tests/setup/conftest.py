"""The scripts of the set-up as modules: they stand in no package."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


@pytest.fixture(scope="module", autouse=True)
def scripts_importable():
    sys.path.insert(0, str(SCRIPTS))
    yield
    sys.path.remove(str(SCRIPTS))


@pytest.fixture
def steps():
    return importlib.import_module("steps")


@pytest.fixture
def commands():
    return importlib.import_module("commands")


@pytest.fixture
def system():
    return importlib.import_module("system")


@pytest.fixture
def mend_wheels():
    return importlib.import_module("mend_wheels")
