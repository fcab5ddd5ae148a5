"""Studies of the rooms that policies learn in."""
