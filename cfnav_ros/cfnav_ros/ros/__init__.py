"""All that speaks ROS: the nodes, the recorder, the player of bags, the graph of processes.

A node converts, calls and publishes.

May import: cfnav_core.command, cfnav_core.detect, cfnav_core.perception, cfnav_core.task,
cfnav_core.policy, cfnav_core.robot, cfnav_ros.robot, cfnav_ros.lidar, cfnav_ros.drive,
cfnav_ros.process, cfnav_ros.bags.files.
"""
