"""The mock TurtleBot 4 on topics: its nodes, its parameters, lock-step with a policy.

May import: cfnav_core.task, cfnav_core.robot, cfnav_core.detect, cfnav_core.perception, sim_bridge.
"""
