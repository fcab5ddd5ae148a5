"""What acts and learns.

A model, the collision predictor (Eq. 3), their reward (Eq. 4), the method, the configuration.

May import: cfnav_core.files, cfnav_core.task, cfnav_core.models, torch.
"""
