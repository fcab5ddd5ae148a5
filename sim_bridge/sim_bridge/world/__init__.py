"""A room in MuJoCo: contacts, scans, pictures, the grid of its reachable states.

May import: cfnav_core.command, cfnav_core.task, cfnav_core.scenes, cfnav_core.detect,
cfnav_core.perception, sim_bridge.room, sim_bridge.sweet_home, mujoco.
"""
