"""A seeded furnished room as a list of parts, without MuJoCo.

May import: cfnav_core.task, sim_bridge.sweet_home.
"""
