"""The navigation models (Eq. 2): a file a paper, `table` names them, `parts` is what they share.

May import: cfnav_core.task, torch.
"""
