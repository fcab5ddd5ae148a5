"""Object categories and room types of the built-in rooms.

The categories are the target lists of both published offline data sets and the plant of the
paper's real-world trials.
"""

from __future__ import annotations

ROOM_TYPES = ("kitchen", "living_room", "bedroom", "bathroom")

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

CATEGORIES = tuple(
    sorted({*DATA1_TARGETS, *(t for row in DATA2_TARGETS.values() for t in row), "HousePlant"})
)
"""Every goal of the built-in rooms, alphabetical; the index is the category id everywhere."""

CATEGORY_ID = {name: i for i, name in enumerate(CATEGORIES)}
