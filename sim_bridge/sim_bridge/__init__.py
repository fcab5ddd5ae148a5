"""The simulated side: seeded rooms, physics, sensors, the data set, and a mock TurtleBot 4.

Knows ``cfnav_core``, never ``cfnav_ros``; the two meet on ROS topics, as with the real robot.
"""
