"""How people furnish each type of room with models: what stands where, beside and on what.

May import: cfnav_core.task, sim_bridge.room, sim_bridge.sweet_home.
"""
