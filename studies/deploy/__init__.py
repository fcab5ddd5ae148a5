"""What a robot can trust: faults, motions, calibration, CPU and memory, on live graphs.

May import: cfnav_core, cfnav_ros, sim_bridge, studies, torch.
"""
