"""A bundle at work.

Its files, its networks, the goals it takes, and `Policy`, which is all a robot needs.

torch is loaded only where its back end is asked for.

May import: cfnav_core.files, cfnav_core.task, cfnav_core.words, cfnav_core.perception,
cfnav_core.detect, cfnav_core.models, cfnav_core.agent, torch.
"""
