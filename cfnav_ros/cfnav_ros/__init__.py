"""The policy on a robot: nodes, and the pure modules they are made of.

Builds on ``cfnav_core``; meets a robot or ``sim_bridge`` on topics alone.
"""
