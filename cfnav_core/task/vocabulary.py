"""Object categories and room types of the built-in rooms.

The categories are the target lists of both published offline data sets and the plant of the
paper's real-world trials.
"""

from __future__ import annotations

FIRST_ROOM_TYPES = ("kitchen", "living_room", "bedroom", "bathroom")
"""Those of bundles and checkpoints that were made before they carried the names themselves."""

ROOM_TYPES = (*FIRST_ROOM_TYPES,)
"""Types of the built-in rooms; a new one is added at the end."""

DATA1_TARGETS = (
    "AlarmClock", "Book", "Bowl", "CellPhone", "Chair", "CoffeeMachine", "DeskLamp", "FloorLamp",
    "Fridge", "GarbageCan", "Kettle", "Laptop", "LightSwitch", "Microwave", "Pan", "Plate", "Pot",
    "RemoteControl", "Sink", "StoveBurner", "Television", "Toaster",
)  # fmt: skip
"""The 22 targets of Offline Data 1, in the order of its detector table."""

DATA2_TARGETS = {
    "kitchen": ("Toaster", "Spatula", "Bread", "Mug", "CoffeeMachine", "Apple"),
    "living_room": ("Painting", "Laptop", "Television", "RemoteControl", "Vase", "ArmChair"),
    "bedroom": ("Blinds", "DeskLamp", "Pillow", "AlarmClock", "CD"),
    "bathroom": ("Mirror", "ToiletPaper", "SoapBar", "Towel", "SprayBottle"),
}
"""The targets of Offline Data 2 by room type."""

FIRST_CATEGORIES = tuple(
    sorted({*DATA1_TARGETS, *(t for row in DATA2_TARGETS.values() for t in row), "HousePlant"})
)
"""What perception networks detect that were made before they carried the names themselves."""

CATEGORIES = (*FIRST_CATEGORIES,)
"""Every goal of the built-in rooms; the index is the category id within one process.

A new word is added at the end. Scenes, perceptions and bundles carry the names that they were made
with, so that they go on as they are.
"""

CATEGORY_ID = {name: i for i, name in enumerate(CATEGORIES)}
