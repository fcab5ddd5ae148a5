"""What the worlds that policies learn in do for them.

May import: cfnav_core, sim_bridge, studies.engine.
"""
