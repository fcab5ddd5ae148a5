"""How fast training, decisions and the live graph are.

May import: cfnav_core, cfnav_ros, torch.
"""
