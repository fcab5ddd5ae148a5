"""A table of a few boards of many sizes that play every role, for tests of rooms."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from sim_bridge.sweet_home.table import VARIABLE

SIZES = {
    "door": (90, 12, 205), "window": (90, 15, 120), "ceiling_lamp": (40, 40, 20),
    "sofa": (190, 85, 80), "low_table": (110, 60, 45), "ArmChair": (75, 75, 80),
    "tv_stand": (140, 45, 50), "Television": (80, 15, 55), "bookcase": (90, 35, 180),
    "dining_table": (140, 80, 75), "Chair": (45, 50, 90), "desk": (130, 65, 75),
    "bed_double": (160, 205, 60), "bed_single": (95, 200, 55), "wardrobe": (120, 60, 200),
    "dresser": (110, 50, 80), "night_stand": (45, 40, 50), "kitchen_base": (60, 60, 88),
    "StoveBurner": (55, 50, 3), "Fridge": (65, 65, 170), "toilet": (40, 65, 75),
    "bathtub": (165, 75, 60), "Sink": (60, 45, 85), "HousePlant": (35, 35, 60),
    "Vase": (18, 18, 30), "Laptop": (34, 25, 22), "Mug": (9, 9, 10), "Book": (25, 18, 3),
    "Microwave": (45, 35, 28), "clutter_top": (15, 12, 10), "clutter_floor": (40, 30, 30),
    "clutter_bath": (10, 10, 15), "clutter_kitchen": (12, 12, 15), "LightSwitch": (9, 2, 9),
}  # fmt: skip
"""Width, depth and height of a role's models, centimetres."""
EXTRA = {
    "HousePlant": {"on": ["floor"]}, "LightSwitch": {"wall": True}, "Sink": {"kind": "pedestal"},
    "kitchen_base": {"style": "oak"}, "StoveBurner": {"kind": "hob"},
    "bed_double": {"goals": {"front": "Pillow"}},
}  # fmt: skip
EACH = 3
"""Models of a role, the last of them held out."""


@pytest.fixture
def little_home(furnish, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Archives and a table with three boards for each role, the third a bit wider."""
    entries, table = [], {}
    for role, (width, depth, height) in SIZES.items():
        table[role] = []
        for k in range(EACH):
            name = f"Test#{role}{k}"
            entries.append({
                "id": name, "name": role, "width": str(width + 2 * k), "depth": str(depth),
                "height": str(height),
            })  # fmt: skip
            table[role].append({"id": name, **EXTRA.get(role, {})})
    furnish(*entries)
    path = tmp_path / "models.yaml"
    path.write_text(yaml.safe_dump(table, sort_keys=False))
    monkeypatch.setenv(VARIABLE, str(path))
