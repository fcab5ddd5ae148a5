"""The LiDAR node's estimates and a bundle's decisions, made again from a bag and scored.

May import: cfnav_core.task, cfnav_core.perception, cfnav_core.policy, cfnav_core.robot,
cfnav_ros.robot, cfnav_ros.lidar, cfnav_ros.drive, cfnav_ros.bags.files, cfnav_ros.bags.judge.
"""
