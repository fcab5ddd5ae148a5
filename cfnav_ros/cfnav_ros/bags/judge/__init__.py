"""From events to drives, touches, outcomes and figures.

May import: cfnav_core.task, cfnav_ros.robot, cfnav_ros.lidar, cfnav_ros.drive,
cfnav_ros.bags.files.
"""
