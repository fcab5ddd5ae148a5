"""What a whole bag of the drive holds."""

from __future__ import annotations

import pytest

from studies.bags.bag_files import drive, write
from studies.bags.fuzz import read


@pytest.fixture(scope="module")
def expected(tmp_path_factory) -> list[tuple]:
    events, notes = read(write(tmp_path_factory.mktemp("whole") / "bag", drive()))
    assert notes == []
    return events
