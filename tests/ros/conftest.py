"""Fixtures of the ROS tests: a small real bag, written without a ROS graph, and real bundles."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cfnav_ros.bags.files.writer import BagWriter, typestore_with
from rosbags.interfaces import Nodetype

from cfnav_core.task.actions import Action

INTERFACES = Path(__file__).parents[2] / "ros_ws" / "src" / "cfnav_interfaces"
SECOND = 1_000_000_000


class SyntheticBag:
    """Writes the topics that the evaluation reads, with exact values and 4 Hz samples."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.store = typestore_with([INTERFACES])
        self.writer = BagWriter(path, self.store)
        for topic, msgtype in {
            "/policy/episode": "cfnav_interfaces/msg/EpisodeStatus",
            "/policy/decision": "cfnav_interfaces/msg/PolicyDecision",
            "/ground_truth/state": "cfnav_interfaces/msg/GroundTruth",
            "/ground_truth/map": "nav_msgs/msg/OccupancyGrid",
            "/collision/estimate": "cfnav_interfaces/msg/CollisionEstimate",
            "/oakd/rgb/preview/image_raw": "sensor_msgs/msg/Image",
        }.items():
            self.writer.add_topic(topic, msgtype)

    def message(self, name: str, **fields: object) -> object:
        """Make a message; fields not given are zero or empty."""
        package, kind = name.split("/")
        full = f"{package}/msg/{kind}"
        values = {
            field: fields[field] if field in fields else _zero(self, kind_of)
            for field, kind_of in self.store.fielddefs[full][1]
        }
        return self.store.types[full](**values)

    def write(self, topic: str, t_ns: int, message: object) -> None:
        """Write one message at its log time."""
        cdr = self.store.serialize_cdr(message, message.__msgtype__)
        self.writer.write(topic, t_ns, bytes(cdr))

    def header(self, t_ns: int) -> object:
        """Make a std_msgs/Header with a stamp."""
        return self.message("std_msgs/Header", stamp=self.stamp(t_ns))

    def stamp(self, t_ns: int) -> object:
        """Make a builtin_interfaces/Time."""
        return self.message("builtin_interfaces/Time", sec=t_ns // SECOND, nanosec=t_ns % SECOND)

    def map(self, t_ns: int, size: int = 200) -> None:
        """Write a walled square room of size cells, 0.02 m each."""
        cells = np.zeros((size, size), np.int8)
        cells[[0, -1], :] = cells[:, [0, -1]] = 100
        cells[80:110, 120:150] = 100
        straight = self.message("geometry_msgs/Quaternion", w=1.0)
        origin = self.message("geometry_msgs/Pose", orientation=straight)
        info = self.message(
            "nav_msgs/MapMetaData", resolution=0.02, width=size, height=size, origin=origin
        )
        grid = self.message(
            "nav_msgs/OccupancyGrid", header=self.header(t_ns), info=info, data=cells.ravel()
        )
        self.write("/ground_truth/map", t_ns, grid)

    def episode(self, t0: int, actions: list[Action], **options: object) -> int:
        """Write one episode, a decision a second, and return the time after it.

        Options: goal, outcome, seen (goal visible at the end), touch (steps with a collision).
        """
        goal = options.get("goal", "Laptop")
        touch = options.get("touch", ())
        x, y, yaw, hits = 1.0, 1.0, 0.0, 0
        self.status(t0, 0, goal, "")
        for step, action in enumerate(actions, 1):
            t = t0 + step * SECOND
            seen = bool(options.get("seen", True)) and step >= len(actions) - 1
            self.truth(t, x, y, yaw, hits, seen, goal)
            self.picture(t)
            self.estimate(t, 0.1 * (step % 10), 1.0)
            self.decision(t + SECOND // 20, t, step, action, goal)
            if step in touch:
                hits += 1
            for part in (1, 2, 3, 4):
                if action is Action.MoveAhead:
                    x += 0.0625 * np.cos(yaw)
                    y += 0.0625 * np.sin(yaw)
                if action in (Action.RotateLeft, Action.RotateRight):
                    yaw += (np.pi / 16) * (1 if action is Action.RotateLeft else -1)
                self.truth(t + part * SECOND // 5, x, y, yaw, hits, seen, goal)
        end = t0 + (len(actions) + 1) * SECOND
        self.status(end, 1, goal, str(options.get("outcome", "done")))
        return end + SECOND

    def status(self, t: int, phase: int, goal: str, outcome: str) -> None:
        """Write an EpisodeStatus."""
        fields = {"phase": phase, "goal": goal, "bundle": "synthetic", "outcome": outcome}
        message = self.message("cfnav_interfaces/EpisodeStatus", header=self.header(t), **fields)
        self.write("/policy/episode", t, message)

    def truth(
        self, t: int, x: float, y: float, yaw: float, hits: int, seen: bool, goal: str
    ) -> None:
        """Write a GroundTruth sample."""
        message = self.message(
            "cfnav_interfaces/GroundTruth",
            header=self.header(t),
            x=float(x),
            y=float(y),
            yaw=float(yaw),
            collisions=hits,
            contact_with="Chair" if hits else "",
            goal_visible=seen,
            room="kitchen:25",
            goal=goal,
            shortest_path=1.0,
        )
        self.write("/ground_truth/state", t, message)

    def decision(self, t: int, image: int, step: int, action: Action, goal: str) -> None:
        """Write a PolicyDecision."""
        message = self.message(
            "cfnav_interfaces/PolicyDecision",
            header=self.header(t),
            goal=goal,
            step=step,
            image_stamp=self.stamp(image),
            action=int(action),
            action_probabilities=np.full(6, 1 / 6, np.float32),
            collision_probability=0.1 * (step % 10),
            detection_score=0.5,
        )
        self.write("/policy/decision", t, message)

    def estimate(self, t: int, probability: float, clearance: float) -> None:
        """Write a CollisionEstimate."""
        message = self.message(
            "cfnav_interfaces/CollisionEstimate",
            header=self.header(t),
            probability=probability,
            clearance=clearance,
        )
        self.write("/collision/estimate", t, message)

    def picture(self, t: int) -> None:
        """Write a 160x160 bgr8 picture, pure red, with padded rows."""
        rows = np.zeros((160, 484), np.uint8)
        rows[:, 2:480:3] = 255
        message = self.message(
            "sensor_msgs/Image",
            header=self.header(t),
            height=160,
            width=160,
            encoding="bgr8",
            step=484,
            data=rows.ravel(),
        )
        self.write("/oakd/rgb/preview/image_raw", t, message)


def _zero(bag: SyntheticBag, kind: tuple) -> object:
    """Return the empty value of a field by its type description."""
    node, description = kind
    if node is Nodetype.NAME:
        return bag.message(description.replace("/msg/", "/"))
    if node is not Nodetype.BASE:
        return np.zeros(0, np.uint8)
    return "" if description[0] == "string" else False if description[0] == "bool" else 0


@pytest.fixture
def synthetic_bag(tmp_path: Path) -> Callable[[], SyntheticBag]:
    """Return a function that opens a new bag at ``tmp_path / "bag"``."""
    return lambda: SyntheticBag(tmp_path / "bag")


@pytest.fixture(scope="session")
def eager_bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bundle of real networks, set by hand: MoveAhead six times whatever it sees, then Done."""
    torch = pytest.importorskip("torch", reason="making a bundle needs torch: run 'make test'")
    from cfnav_core.agent.agent import new_agent
    from cfnav_core.agent.config import RunConfig
    from cfnav_core.files.provenance import sha256
    from cfnav_core.learn.export import export_networks
    from cfnav_core.models.base import Knowledge, ObservationSpec
    from cfnav_core.models.size import ModelSize
    from cfnav_core.perception.net import PerceptionNet, export_perception
    from cfnav_core.policy.bundle import NETWORKS, WEIGHTS, BundleHead
    from cfnav_core.task.detections import SCORES
    from cfnav_core.task.vocabulary import CATEGORIES

    folder = tmp_path_factory.mktemp("eager")
    torch.manual_seed(0)
    inputs = ObservationSpec((256,), SCORES, CATEGORIES)
    config = RunConfig(method="plain", size=ModelSize(16), predictor_hidden=16)
    agent = new_agent(config, inputs, Knowledge())
    model = agent.model
    for parameter in (*model.lstm.parameters(), *model.actor.parameters()):
        torch.nn.init.zeros_(parameter)
    with torch.no_grad():
        # All gates open and every input tanh(0.1): the state counts steps, h = tanh(0.1 t).
        gates = model.lstm.bias_ih.view(4, 16)
        gates[:] = 10.0
        gates[2] = 0.1
        model.actor.bias[Action.MoveAhead] = 1.0
        model.actor.weight[Action.Done, 0] = 100.0
        model.actor.bias[Action.Done] = -57.0  # passes 1 between h of 6 and of 7 steps
    export_perception(PerceptionNet(), folder / "perception.onnx")
    export_networks(agent, inputs, folder)
    (folder / WEIGHTS).touch()  # the networks hold their numbers themselves
    BundleHead(
        name="eager",
        method="plain",
        feeds_prediction=False,
        objects=CATEGORIES,
        goals=CATEGORIES,
        files={name: sha256(folder / name) for name in (*NETWORKS, WEIGHTS)},
        training={},
        metrics={},
    ).save(folder)
    return folder


@pytest.fixture(scope="session")
def make_bundle(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Return a function: names of actions -> a bundle that answers them, then repeats the last."""
    from tests.ros.listed_actions import ListedActions

    return ListedActions(tmp_path_factory.mktemp("bundles"))
