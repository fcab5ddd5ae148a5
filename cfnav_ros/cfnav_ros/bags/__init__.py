"""Bags of drives, judged without ROS.

`files` reads and writes them, `judge` finds drives and touches, `replay` decides again, `health`
tells what the data lack.

May import: cfnav_core.command, cfnav_core.task, cfnav_core.perception, cfnav_core.policy,
cfnav_core.robot, cfnav_ros.robot, cfnav_ros.lidar, cfnav_ros.drive.
"""
