"""What several navigation models share: encoders, heads, graphs, and how detections are read.

May import: cfnav_core.models, cfnav_core.task, torch.
"""
