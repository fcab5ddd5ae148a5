"""Child processes, the nodes that they are, their ROS domain, and the signals that stop them.

May import: cfnav_core.command, cfnav_core.policy, cfnav_core.robot, cfnav_core.task,
cfnav_ros.drive.
"""
