"""Trials on the live graph: Table IV and the figures of long runs.

May import: cfnav_core, cfnav_ros, sim_bridge, studies.engine, studies.paper.
"""
