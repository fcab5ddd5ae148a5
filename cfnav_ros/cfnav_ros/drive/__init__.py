"""One episode on a robot, without ROS.

Inputs and their ages, motions, watches, what ends or stops a drive.

May import: cfnav_core.task, cfnav_core.perception, cfnav_core.detect, cfnav_core.policy,
cfnav_core.robot, cfnav_ros.robot, cfnav_ros.lidar.
"""
