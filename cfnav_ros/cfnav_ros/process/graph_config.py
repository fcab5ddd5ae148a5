"""What a graph with a mock robot is started with, and what each node is told. Knows no ROS."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cfnav_core.policy.bundle import BundleHead, bundle_elsewhere, find_bundle
from cfnav_core.robot.robot import load_robot, simulated
from cfnav_core.task.camera import CameraSetUp
from cfnav_core.task.p_hat import SOURCES, PHat
from cfnav_ros.drive.detection_watch import MOCK_LABELS
from cfnav_ros.drive.limits import EpisodeLimits
from cfnav_ros.process.nodes import NodeStart, parts


@dataclass(frozen=True)
class GraphConfig:
    """What to start.

    Attributes:
        room: the room that the simulator starts with, such as ``kitchen:25``.
        logs: folder for the log of each process.
        speed: simulated seconds per wall second; 0 is as fast as it goes.
        bundle: what drives: a folder, or the name of a shipped one; None is the robot's.
        veto: whether the LiDAR may forbid a MoveAhead.
        domain: ROS domain; None draws a free one.
        bag: where everything is recorded; None records nothing.
        lock_step: the simulator waits for the policy, so that an episode repeats itself.
        camera: the robot's, of ``task.camera.CAMERAS`` or a JSON file; any drives.
        depth_down_deg: by which a stereo camera looks down whose depth the mock publishes, too;
            0: it sits where the camera does and tilts with it; None: there is none.
        robot: the name of one that is shipped, or its file; when None the TurtleBot 4 whose camera
            tilts or not, as this one does.
        p_hat: where the collision probability comes from, see ``EpisodeLimits``; or "true", what
            the simulator knows, which then speaks in place of the LiDAR node.
        sample_seed: the policy draws its actions with this seed; argmax when None.
        visual_shift: of the pictures against those of training, 0 to 1.
        detector: what detects where the bundle reads what a detector says: errors of one that is
            on board, "shipped" or a file of them, or an ONNX file that is run on the pictures.
        labels: what the ONNX file learnt.
        track: whether ``RosGraph.track`` follows the true path of each episode.
        room_type: of all rooms, for bundles that look it up; "" where they have several.
    """

    room: str
    logs: Path
    speed: float = 1.0
    bundle: Path | None = None
    veto: bool = True
    domain: int | None = None
    bag: Path | None = None
    lock_step: bool = False
    camera: str = "mast"
    depth_down_deg: float | None = None
    robot: str | Path | None = None
    p_hat: PHat = "lidar"
    sample_seed: int | None = None
    visual_shift: float = 0.0
    detector: str = "shipped"
    labels: str = "coco"
    track: bool = False
    room_type: str = ""

    @property
    def described(self) -> str:
        """Name or file of the robot."""
        return str(self.robot or simulated(CameraSetUp.read(self.camera).tilts))

    @property
    def drives(self) -> Path:
        """Folder of the bundle."""
        return find_bundle(self.bundle or load_robot(self.described).bundle).resolve()

    @property
    def detection(self) -> tuple[list[str], dict[str, object]]:
        """Further nodes and parameters, where the bundle reads what a detector says."""
        if not BundleHead.load(self.drives).reads_sightings:
            return [], {}
        if not self.detector.endswith(".onnx"):
            known = {"detector_labels": MOCK_LABELS, "detections.labels": MOCK_LABELS}
            return [], {"detector": self.detector, **known}
        model = Path(self.detector).resolve()
        said = {"model": model, "labels": self.labels, "detections.labels": self.labels}
        return ["detector_node"], said

    @property
    def parts(self) -> list[NodeStart]:
        """The nodes and what each is told, in the order in which they start."""
        told = "truth" in SOURCES[self.p_hat].needs
        lidar = [] if told else ["lidar_collision_node"]
        # What this machine takes for a command is as many times longer in simulated time.
        lag = min(EpisodeLimits().command_lag * self.speed, 10.0) if self.speed > 1 else None
        learnt_from = BundleHead.load(self.drives).camera
        other = not learnt_from or not learnt_from.sees_like(CameraSetUp.read(self.camera))
        detectors, detecting = self.detection
        given = {
            "robot": self.described, "room": self.room, "speed": float(self.speed),
            "camera": self.camera, "depth": self.depth_down_deg is not None or None,
            "depth_down_deg": self.depth_down_deg,
            "visual_shift": float(self.visual_shift),
            "true_estimate": told or None, "lock_step": self.lock_step, "use_sim_time": True,
            "episode.veto": self.veto, "episode.p_hat": "lidar" if told else self.p_hat,
            "episode.command_lag": lag,
            "sample_seed": self.sample_seed, "other_camera": other or None,
            "bundle": bundle_elsewhere(self.drives), "room_type": self.room_type or None,
            **detecting,
        }  # fmt: skip
        return parts(["mock_turtlebot4", *lidar, *detectors, "policy_node"], given)
