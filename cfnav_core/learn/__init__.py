"""Training and evaluation.

The environment, Algorithm 1, the state of a run, frozen episodes, the export of a bundle.

May import: cfnav_core, torch, gymnasium.
"""
