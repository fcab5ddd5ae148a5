"""Samples of the simulator's truth, drawn by hand, and a look into the table of expectations."""

import math

from studies.deploy.expectations import EXPECTATIONS
from studies.deploy.judge import TruthSample

STEP, TURN, PAUSE = (1.25, 0.2, 0.0), (1.0, 0.0, math.pi / 4), (0.5, 0.0, 0.0)
"""Parts of a drive: seconds, m/s, rad/s."""


def cell(fault, phase):
    return next(e for e in EXPECTATIONS if e.fault == fault and e.phase is phase)


def drive(*parts, begin=10.0, collisions=0):
    """Truth at 20 Hz of parts (seconds, v, w), at rest a second before and after."""
    truth, t, x, yaw, still = [], begin - 1.0, 0.0, 0.0, 1.0
    for seconds, v, w in ((1.0, 0.0, 0.0), *parts, (1.0, 0.0, 0.0)):
        moving = v != 0 or w != 0
        still = 0.0 if moving else t
        for _ in range(round(seconds / 0.05)):
            truth.append(TruthSample(t, x, 0.0, yaw, v, w, still, 0))
            t, x, yaw = t + 0.05, x + 0.05 * v * math.cos(yaw), yaw + 0.05 * w
    truth[-1] = TruthSample(t, x, 0.0, yaw, 0.0, 0.0, still, collisions)
    return truth
