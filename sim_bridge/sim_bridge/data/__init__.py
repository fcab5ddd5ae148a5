"""Data made from rooms: offline scenes, labelled pictures, scans, the share of overhangs.

May import: cfnav_core.command, cfnav_core.files, cfnav_core.task, cfnav_core.scenes,
cfnav_core.perception, cfnav_core.policy, sim_bridge.room, sim_bridge.world, sim_bridge.robot.
"""
