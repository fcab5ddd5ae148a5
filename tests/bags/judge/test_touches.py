"""What a real robot can know of its touches, against the truth of simulated drives without ROS."""

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from cfnav_ros.bags.files.events import Bumps, Event, Pose, Truth, Velocity
from cfnav_ros.bags.judge.contacts import BUMP, OBSERVABLE, STALL, TRUTH
from cfnav_ros.bags.judge.drives import DriveFinder
from cfnav_ros.bags.judge.outcomes import judge
from cfnav_ros.drive.conduct import Conduct
from cfnav_ros.drive.inputs import SensorInputs
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.drive.motion import STOP, Command, Motion, Odometry, Status
from sim_bridge.robot.noise import Noise, NoiseLevels
from sim_bridge.robot.simulator import Simulator
from sim_bridge.room.room import generate_room
from sim_bridge.world.grid import state_grid
from sim_bridge.world.world import World

from cfnav_core.task.actions import Action
from tests.bags.made import at, end, start

ROOMS = ("kitchen", "living_room", "bedroom", "bathroom")
PERIOD_STEPS, REST_PERIODS, MOTIONS = 5, 12, 12
BEGIN = 100.0


class Robot:
    """The executor at 20 Hz on the simulator, driven blindly; what it publishes is ``events``."""

    def __init__(self, seed: int, bumper: bool) -> None:
        rng = np.random.default_rng(seed)
        world = World(generate_room(ROOMS[seed % 4], seed // 4))
        self.simulator = Simulator(world, Noise(NoiseLevels().scaled(1.0), seed), reflexes=True)
        free = [p for p in state_grid(world).positions if world.free(*p)]
        x, y = free[rng.integers(len(free))]
        self.simulator.place(x, y, rng.integers(8) * math.pi / 4)
        self.bumper, self.actions = bumper, rng.choice(3, MOTIONS, p=(0.7, 0.15, 0.15))
        self.events: list[Event] = [start(BEGIN)]
        self._arrived: dict[str, float] = {}
        self._bumper = False
        self._conduct = Conduct(EpisodeLimits())
        self._publish()

    @property
    def now(self) -> float:
        return BEGIN + self.simulator.time

    def drive(self) -> Iterator[Event]:
        origin = self._odometry.yaw
        self._conduct.start(self.now, self._inputs())
        for action in self.actions:
            motion = Motion(Action(action), self.now, self._odometry, origin)
            while True:
                self._conduct.follow(self.now, self._inputs(), motion)
                command, status = motion.update(self.now, self._odometry)
                if status is not Status.DRIVING:
                    break
                self._tick(command)
            for _ in range(REST_PERIODS):
                self._tick(STOP)
        yield from [*self.events, end(self.now, outcome="step_limit")]

    def _inputs(self) -> SensorInputs:
        return SensorInputs(odometry=self._odometry, arrived=self._arrived, bumper=self._bumper)

    def _tick(self, command: Command) -> None:
        self.events.append(Velocity(**at(self.now, topic="cmd_vel"), v=command.v, w=command.w))
        self.simulator.command(command.v, command.w)
        for _ in range(PERIOD_STEPS):
            if self.simulator.step():
                self._feel()
        self._publish()

    def _publish(self) -> None:
        o, (v, w) = self.simulator.odometry, self.simulator.twist
        self._odometry = Odometry(self.now, o.x, o.y, o.yaw, v, w)
        self.events.append(Pose(**at(self.now, topic="odom"), x=o.x, y=o.y, yaw=o.yaw, v=v, w=w))
        self._feel()

    def _feel(self) -> None:
        simulator, pose = self.simulator, self.simulator.world.pose
        truth = Truth(
            **at(self.now, topic="ground_truth/state"), x=pose.x, y=pose.y, yaw=pose.yaw, v=0.0,
            collisions=simulator.collisions.count, contact_with="",
            impact_speed=simulator.collisions.impact_speed, goal="Mug", goal_visible=False,
            room="", shortest_path=1.0,
        )  # fmt: skip
        self.events.append(truth)
        if not self.bumper:
            return
        pressed = bool(simulator.pressed())
        zones = ("bump_front",) * pressed
        self.events.append(Bumps(**at(self.now, topic="hazard_detection"), zones=zones))
        self._bumper = pressed
        if pressed:
            self._arrived = {"bumped_at": self.now}


def steps_of(events: list[Event]) -> float:
    """Metres from one pose to the next."""
    poses = [event for event in events if isinstance(event, Pose)]
    return sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(poses))


@pytest.mark.parametrize(("bumper", "counts"), [(True, (BUMP, OBSERVABLE)), (False, (STALL,))])
def test_touches_are_known_without_the_truth(bumper, counts):
    found = []
    for seed in range(8):
        finder = DriveFinder()
        robot = Robot(seed, bumper)
        drives = [drive for event in robot.drive() for drive in finder.see(event)]
        (drive,) = drives + finder.finish()
        outcome = judge(drive)
        by = outcome.collisions_by
        # Its odometry slips and drifts but has no noise: no step is smoothed away.
        assert outcome.path_length_m.value == pytest.approx(steps_of(robot.events), abs=1e-9)
        assert outcome.path_length_m.why == outcome.collisions.why == ""
        found.append([by[TRUTH], *(by[source] for source in counts)])
    table = np.array(found)
    assert (table[:, 0] == 0).any()
    assert table[:, 0].sum() >= 10
    # Whether a drive touched anything at all is known of each, how often of nearly all touches.
    assert ((table > 0) == (table[:, :1] > 0)).all()
    assert np.abs(table - table[:, :1]).sum() <= 0.1 * table[:, 0].sum()
