"""From a scan, and depth, to the probability that a motion collides.

Returns, mounting, error model, estimate; what depth shows, and remembers, beside it.

May import: cfnav_core.files, cfnav_core.task, cfnav_core.robot, cfnav_core.scenes,
cfnav_ros.robot.
"""
