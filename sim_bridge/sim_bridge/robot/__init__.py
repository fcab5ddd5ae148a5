"""The simulated robot: base and odometry, LiDAR, collisions, noise, and `Simulator.step()`.

May import: cfnav_core.task, sim_bridge.world.
"""
