"""From a picture to features and detections: the network that is run, and how it is trained.

Only `net`, `trunk` and `train` need torch.

May import: cfnav_core.files, cfnav_core.task, torch.
"""
