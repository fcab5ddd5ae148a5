"""Collision-aware object-goal navigation: data, training, metrics and the deployable policy.

Knows neither ROS nor a simulator; ``cfnav_ros`` and ``sim_bridge`` build on it.
"""

__version__ = "0.1.0"
