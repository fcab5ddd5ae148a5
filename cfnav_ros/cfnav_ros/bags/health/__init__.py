"""What the data of a bag lack: gaps, rates, stamps, frozen pictures, blind scans.

May import: cfnav_ros.robot, cfnav_ros.lidar, cfnav_ros.drive, cfnav_ros.bags.files,
cfnav_ros.bags.judge, cfnav_ros.bags.replay.
"""
