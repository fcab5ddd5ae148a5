"""What people look at: the HTML page about bags and its pictures, and `bag_eval`, which makes it.

May import: cfnav_core.command, cfnav_core.files, cfnav_core.policy, cfnav_core.task,
cfnav_ros.lidar, cfnav_ros.bags.
"""
