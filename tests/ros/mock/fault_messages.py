"""Messages as the mock makes them, and what faults make of them."""

from __future__ import annotations

import math
from copy import deepcopy

import numpy as np
from sim_bridge.faults.faults import (
    CAMERA_INFO,
    DEPTH,
    DEPTH_INFO,
    DOCK,
    HAZARDS,
    IMAGE,
    JOINTS,
    SCAN,
    TF,
    WHEELS,
)
from sim_bridge.faults.schedule import FaultOrder, FaultSchedule
from sim_bridge.robot.base import SimulatedOdometry, TrueMotion
from sim_bridge.robot.rplidar import SENSITIVITY, driver_ranges, sample_angles
from sim_bridge.ros import conversions as to_msg
from tf2_msgs.msg import TFMessage

from cfnav_core.task.camera import CAMERAS

T0 = 20.0


def make(topic, k=0):
    """The k-th message of a topic; each differs from the one before."""
    t = T0 + 0.1 * k
    rng = np.random.default_rng(k)
    if topic == SCAN:
        angles = sample_angles(SENSITIVITY, 0.5)
        distances = rng.uniform(0.5, 4.0, len(angles)).astype(np.float32)
        return to_msg.laser_scan(driver_ranges(angles, distances, SENSITIVITY), t, "laser")
    if topic == IMAGE:
        return to_msg.image(rng.integers(0, 255, (60, 60, 3), np.uint8), t)
    if topic in (CAMERA_INFO, DEPTH_INFO):
        return to_msg.camera_info(CAMERAS["mast"], t)
    if topic == DEPTH:
        return to_msg.depth(rng.integers(400, 4000, (60, 80), np.uint16), t, "optical")
    if topic == JOINTS:
        return to_msg.joint_state("neck", 0.1 * k, t)
    if topic == HAZARDS:
        return to_msg.hazards([0.0], True, t)
    if topic in (WHEELS, DOCK):
        return (to_msg.wheel_status if topic == WHEELS else to_msg.dock_status)(True, t)
    counted = SimulatedOdometry()
    counted.move(1.0 + k, 0.5, 0.7)
    if topic == TF:
        return TFMessage(transforms=to_msg.moving_transforms(counted, CAMERAS["mast"], 0.0, t))
    return to_msg.odometry(counted, (0.1 + k, 0.2), t)


def suffered(faults, topic, count=20, seed=0):
    """What becomes of ``count`` messages: (message or None, delay) each; and the originals.

    ``faults`` is a name, or several that begin in this order.
    """
    names = [faults] if isinstance(faults, str) else faults
    schedule = FaultSchedule([FaultOrder(name) for name in names], seed)
    schedule.update(T0, TrueMotion(0.0, 0.0, None))
    originals = [make(topic, k) for k in range(count)]
    return [
        schedule.pass_on(topic, deepcopy(message), T0 + 0.1 * k)
        for k, message in enumerate(originals)
    ], originals


def first(fault, topic):
    results, originals = suffered(fault, topic, 1)
    return results[0][0], originals[0]


def payload(message):
    """The bytes of a scan or a picture; NaN equals NaN."""
    numbers = getattr(message, "ranges", getattr(message, "data", None))
    return message.header, None if numbers is None else numbers.tobytes()


def stamp_s(message):
    return message.header.stamp.sec + message.header.stamp.nanosec * 1e-9


def bearing(scan):
    """Bearing of each bin from the robot's front, rad."""
    angles = scan.angle_min + np.arange(len(scan.ranges)) * scan.angle_increment
    return np.angle(np.exp(1j * (angles + math.pi / 2)))
