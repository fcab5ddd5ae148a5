"""Bags on disk: MCAP and SQLite, message types, topics and their roles, typed events.

May import: cfnav_core.command, cfnav_core.task, cfnav_core.robot, cfnav_ros.robot, cfnav_ros.lidar,
cfnav_ros.drive.
"""
