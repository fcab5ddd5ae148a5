"""Replayed decisions by hand."""

import numpy as np
from cfnav_ros.bags.replay.step import ReplayStep

from cfnav_core.task.actions import Action


def step_of(**fields):
    """A step of a MoveAhead that the bundle agrees with, but for the given fields."""
    plain = {
        "bag": "bag", "bundle": "ours", "driver": "", "drive_ns": 0, "goal": "Mug", "step": 1,
        "t_ns": 0, "until_ns": 1, "image_ns": 0, "estimate_ns": 1, "driven": Action.MoveAhead,
        "driven_vetoed": False, "driven_probabilities": None, "driven_p_hat": None,
        "action": Action.MoveAhead, "probabilities": np.eye(6, dtype=np.float32)[0],
        "p_hat": 0.1, "p_hat_lidar": 0.1, "p_hat_rgb": 0.1, "detection_score": 0.5,
        "would_veto": False,
        "intact": True,
    }  # fmt: skip
    return ReplayStep(**(plain | fields))
