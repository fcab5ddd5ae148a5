"""Graphs that people start: the demo, and bringup, which does without launch files.

May import: cfnav_core.command, cfnav_core.detect, cfnav_core.files, cfnav_core.task,
cfnav_core.policy, cfnav_core.robot, cfnav_ros.
"""
