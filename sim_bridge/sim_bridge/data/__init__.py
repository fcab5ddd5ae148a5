"""Data made from rooms: offline scenes, labelled pictures, scans, the share of overhangs.

Of rooms and of furniture models also the pages to look at them.

May import: cfnav_core.command, cfnav_core.files, cfnav_core.task, cfnav_core.scenes,
cfnav_core.perception, cfnav_core.detect, cfnav_core.policy, sim_bridge.room, sim_bridge.sweet_home,
sim_bridge.world, sim_bridge.robot, mujoco.
"""
