"""What the mock's nodes publish, and when."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

from builtin_interfaces.msg import Time
from cfnav_interfaces.msg import FaultStatus, Moment
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from cfnav_core.robot.robot import Robot
from cfnav_core.robot.topics import CLOUD, COMPRESSED
from sim_bridge.faults.faults import (
    CAMERA_INFO,
    DEPTH,
    DEPTH_INFO,
    DETECTIONS,
    DOCK,
    HAZARDS,
    IMAGE,
    JOINTS,
    ODOM,
    SCAN,
    TF,
    WHEELS,
)
from sim_bridge.faults.outbox import Outbox
from sim_bridge.faults.robot_clock import RobotClock
from sim_bridge.faults.scan_faults import stranger
from sim_bridge.faults.schedule import FaultSchedule
from sim_bridge.robot.lidar_turn import LidarTurn
from sim_bridge.robot.rplidar import MODES, STANDARD
from sim_bridge.ros import conversions as to_msg
from sim_bridge.ros.detector import detections
from sim_bridge.ros.lock_step import PATIENCE_S
from sim_bridge.ros.pacing import Every
from sim_bridge.ros.parameters import MockParameters
from sim_bridge.ros.robot_node import (
    BATTERY,
    CLOCK,
    IMU,
    TF_STATIC,
    RivalNode,
    RobotNode,
)
from sim_bridge.ros.simulator_node import SimulatorNode
from sim_bridge.ros.stage import SimulatorStage

CAMERA_PERIOD = 1.0 / 15.0
DETECTION_PERIOD, DETECTION_LATENCY = 1.0 / 7.5, 0.1
"""Of a detector on a camera's chip: every other picture, and so much later than it."""
DEPTH_PERIOD = 1.0 / 10.0
"""An OAK-D can 30 Hz, at 15 MB/s; a robot's driver is told to send fewer."""
STATE_PERIOD = 1.0 / 20.0
"""Also of the wheels' status, which a base sends at 62.5 Hz: nobody reads it faster than odometry,
and each message costs a Python node that listens."""
DOCK_PERIOD, BATTERY_PERIOD = 1.0, 10.0
"""The battery as in create3_sim; the dock's status also at every change."""
MAP_RESOLUTION = 0.02
SENSORS = (IMAGE, SCAN, ODOM)


class Broadcast:
    """Publishes what is due of a stage.

    Args:
        robot, simulator_node: the nodes, connected.
        stage: what there is to see.
        clock: stamps the robot's messages.
        faults: what becomes of them.
        parameters: of the mock.
        described: the robot that it is.

    Attributes:
        outbox: messages under way, commands to the robot included.
        running: whether LiDAR and camera run, by name; on the dock they do not in any case.
        rival: another node that sends scans, if there is one.
    """

    def __init__(
        self,
        robot: RobotNode,
        simulator_node: SimulatorNode,
        stage: SimulatorStage,
        clock: RobotClock,
        faults: FaultSchedule,
        parameters: MockParameters,
        described: Robot,
    ) -> None:
        self._robot, self._simulator_node, self._stage = robot, simulator_node, stage
        self._simulator, self._clock = stage.simulator, clock
        self._set_up, self._lidar_frame = parameters.set_up, described.lidar.frame
        self._packed = described.topics[IMAGE].type == COMPRESSED
        self._stereo_set_up = parameters.stereo_set_up
        self._points = parameters.depth and described.topics[DEPTH].type == CLOUD
        self._depth_fixed = parameters.depth and parameters.depth_down_deg > 0
        self._joint = described.tilt_joint if parameters.set_up.tilts else ""
        self.outbox = Outbox(faults)
        self.running = {"lidar": True, "camera": True}
        self.rival: RivalNode | None = None
        self._scan_mode = MODES[parameters.scan_mode]
        self._turn = LidarTurn()
        self._sent: dict[str, Time] = {}
        self._hazards: list[tuple[int, str]] | None = None
        self._restarted = 0.0
        self._docked = self._simulator.docked
        self._camera_runs = True
        self._schedule = (
            Every(STATE_PERIOD, self._state),
            Every(CAMERA_PERIOD, self._picture),
            *[Every(DEPTH_PERIOD, self._depth)] * parameters.depth,
            *[Every(DETECTION_PERIOD, self._detections)] * bool(parameters.detector),
            Every(DOCK_PERIOD, self._dock),
            Every(BATTERY_PERIOD, self._battery),
        )

    @property
    def _now(self) -> float:
        """What the robot's clock shows, s."""
        return self._clock(self._simulator.time)

    def restart(self) -> None:
        """Drop what is under way and begin every period now."""
        t = self._simulator.time
        self.outbox.clear()
        self._sent.clear()
        self._hazards = None  # what was under way told of them is gone
        self._restarted = t
        self._turn.restart(t)
        for every in self._schedule:
            every.restart(t)

    def publish(self, collision_began: bool) -> None:
        """Publish what is due, the time first so that no stamp lies in a receiver's future.

        A message on /clock every step would cost each Python node that listens a sixth of a core;
        so messages that come late are no reason for one, and the gyroscope speaks when odometry or
        camera do: 30 times a second (turtlebot4_diagnostics expects 30 to 35 through the relay).
        """
        t = self._simulator.time
        self._switch_camera()
        due = [every.action for every in self._schedule if every.due(t)]
        if self._state in due or self._picture in due:
            due.append(self._imu)
        if self._turn.complete(t, self._simulator.world.pose):
            due.append(self._scan)
        if collision_began and self._state not in due:
            due.append(self._contact)
        if self._docked != self._simulator.docked:
            self._docked = self._simulator.docked
            due.append(self._dock)
        if due and CLOCK in self._robot.out and self._clock.stopped_at is None:
            self._send(CLOCK, Clock(clock=to_msg.stamp(self._now)))
            # At once: the truth and a rival's scan do not go through the outbox.
            self.outbox.release(t)
        for action in due:
            action()
        self.outbox.release(t)

    def _switch_camera(self) -> None:
        """Let the camera's publishers come and go with it."""
        runs = self.running["camera"] and not self._simulator.docked
        if runs is not self._camera_runs:
            self._camera_runs = runs
            self._sent.pop(IMAGE, None)
            self._sent.pop(DETECTIONS, None)
            self._robot.run_camera(runs)

    def mounts(self) -> None:
        """Publish where the sensors sit."""
        mounts = to_msg.static_transforms(self._set_up, self._now, self._lidar_frame)
        if self._depth_fixed:
            mounts += to_msg.depth_transforms(self._stereo_set_up, self._now)
        if TF_STATIC in self._robot.out:
            self._robot.out[TF_STATIC].publish(TFMessage(transforms=mounts))

    def map(self) -> None:
        """Publish the plan of the room."""
        grid = self._simulator.world.occupancy(MAP_RESOLUTION)
        t = self._clock.true(self._simulator.time)
        self._simulator_node.map.publish(to_msg.occupancy_grid(grid, MAP_RESOLUTION, t))

    def fault(self, name: str, holds: bool) -> None:
        """Say that a fault began or ended."""
        header = to_msg.header(self._clock.true(self._simulator.time), "")
        self._simulator_node.fault.publish(FaultStatus(header=header, fault=name, active=holds))

    def moment(self) -> tuple[Time, int] | None:
        """Announce the moment: what was sent last of each sensor.

        Returns:
            Its stamp and how many hear it; None soon after a start, while a sensor is to speak, and
            where nobody waits for moments.
        """
        t, publisher = self._simulator.time, self._simulator_node.moment
        complete = all(topic in self._sent for topic in SENSORS)
        if publisher is None or (not complete and t - self._restarted < PATIENCE_S):
            return None
        stamp = to_msg.stamp(self._now)
        topics = (*SENSORS, DETECTIONS)
        image, scan, odom, said = (self._sent.get(topic, Time()) for topic in topics)
        if DETECTIONS not in self._robot.out:
            said = image  # a detector in a node of its own says something of every picture
        moment = Moment(stamp=stamp, image=image, scan=scan, odometry=odom, detections=said)
        publisher.publish(moment)
        return stamp, publisher.get_subscription_count()

    def _send(self, topic: str, message: Any, latency: float = 0.0) -> None:
        if topic not in self._robot.out:
            return  # this robot has none

        def deliver(message: Any) -> None:
            if self._robot.say(topic, message) and topic in (*SENSORS, DETECTIONS):
                self._sent[topic] = message.header.stamp

        self.outbox.put(topic, message, deliver, self._simulator.time, latency)

    def _state(self) -> None:
        simulator, now = self._simulator, self._now
        tilt, late = simulator.world.pose.tilt, self._stage.noise.levels.odometry_latency
        self._send(ODOM, to_msg.odometry(simulator.odometry, simulator.twist, now), late)
        moving = to_msg.moving_transforms(simulator.odometry, self._set_up, tilt, now)
        self._send(TF, TFMessage(transforms=moving), late)
        self._send(JOINTS, to_msg.joint_state(self._joint, tilt, now))
        self._send(WHEELS, to_msg.wheel_status(simulator.wheels_enabled, now))
        self._contact()

    def _contact(self) -> None:
        simulator = self._simulator
        if self.rival is not None and "estimate_rival" in self.rival.out:
            free = to_msg.true_estimate(True, self._now)  # whatever is there
            self.rival.out["estimate_rival"].publish(free)
        found = to_msg.hazards(simulator.pressed(), simulator.backup_low, self._now)
        hazards = [(hazard.type, hazard.header.frame_id) for hazard in found.detections]
        if hazards != self._hazards:  # told when they change, as firmware H.2.5 and later does
            self._hazards = hazards
            self._send(HAZARDS, found)
        truth = to_msg.ground_truth(simulator, self._stage.goal_visible(), self._clock.epoch)
        self._simulator_node.truth.publish(truth)

    def _scan(self) -> None:
        began = self._clock(self._turn.began)
        if self.running["lidar"] and not self._simulator.docked:
            standard = "scan_standard" in self._simulator.faults
            mode = STANDARD if standard else self._scan_mode
            ranges = self._turn.ranges(self._simulator.world, self._stage.noise, mode)
            scan = to_msg.laser_scan(ranges, began, self._lidar_frame)
            if self.rival is not None and "scan_rival" in self.rival.out:
                other = deepcopy(scan)
                stranger(other)
                self.rival.out["scan_rival"].publish(other)
            self._send(SCAN, scan)
            if self._simulator_node.estimate is not None:
                free = self._simulator.ahead_free()
                self._simulator_node.estimate.publish(to_msg.true_estimate(free, began))
        self._turn.next()

    def _picture(self) -> None:
        if not self._camera_runs:
            return
        now, late = self._now, self._stage.noise.levels.image_latency
        make = to_msg.compressed_image if self._packed else to_msg.image
        self._send(IMAGE, make(self._stage.picture(CAMERA_PERIOD), now), late)
        self._send(CAMERA_INFO, to_msg.camera_info(self._set_up, now), late)

    def _detections(self) -> None:
        if self._camera_runs:
            found = self._stage.detections()
            self._send(DETECTIONS, detections(found, self._now), DETECTION_LATENCY)

    def _depth(self) -> None:
        if not self._camera_runs:
            return
        now, late = self._now, self._stage.noise.levels.depth_latency
        frame = to_msg.DEPTH_FRAME if self._depth_fixed else to_msg.CAMERA_FRAME
        millimetres, set_up = self._stage.depth(), self._stereo_set_up
        if self._points:
            message = to_msg.depth_cloud(millimetres, set_up, now, frame)
        else:
            message = to_msg.depth(millimetres, now, frame)
        self._send(DEPTH, message, late)
        self._send(DEPTH_INFO, to_msg.camera_info(set_up, now, frame), late)

    def _imu(self) -> None:
        simulator = self._simulator
        self._send(IMU, to_msg.imu(simulator.odometry, simulator.twist, self._now))

    def _dock(self) -> None:
        docked, visible = self._simulator.docked, self._simulator.dock_visible
        self._send(DOCK, to_msg.dock_status(docked, self._now, visible))

    def _battery(self) -> None:
        self._send(BATTERY, to_msg.battery_state(self._simulator.docked, self._now))
