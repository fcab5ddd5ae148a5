"""A policy that reads what a detector says, on a live graph with the mock's detector on board."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")
pytest.importorskip("torch", reason="making a bundle needs torch: run 'make test'")

from cfnav_interfaces.srv import SetFault  # noqa: E402
from cfnav_ros.bags.evaluation import JudgeOptions, evaluate  # noqa: E402
from cfnav_ros.drive.detection_watch import MOCK_LABELS, DetectionSettings  # noqa: E402
from cfnav_ros.live.demo import DemoConfig, known_goals  # noqa: E402
from cfnav_ros.process.graph_config import GraphConfig  # noqa: E402
from cfnav_ros.process.processes import GraphError  # noqa: E402
from cfnav_ros.ros.graph import RosGraph  # noqa: E402
from rosbags.highlevel import AnyReader  # noqa: E402

from cfnav_core.learn.export import export_bundle  # noqa: E402
from cfnav_core.robot.robot import load_robot  # noqa: E402
from cfnav_core.task.actions import Action  # noqa: E402
from studies.deploy.bundles import make_bundle  # noqa: E402
from studies.deploy.pool import NO_ERRORS  # noqa: E402
from tests.core.detect.made import constant_network  # noqa: E402
from tests.core.model_samples import save_fresh  # noqa: E402

ROOM = "bathroom:20"
IMAGE = "/oakd/rgb/preview/image_raw"
LISTS = {"Sink": [Action.RotateLeft, Action.MoveAhead, Action.RotateRight, Action.Done]}


@pytest.fixture
def graph(
    tmp_path: Path, ros_domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> Iterator[RosGraph]:
    for name in ("ROS_DOMAIN_ID", "ROS_LOG_DIR"):  # the graph sets them
        monkeypatch.setenv(name, os.environ.get(name, ""))
    config = GraphConfig(
        ROOM, tmp_path / "logs", speed=0, lock_step=True, domain=ros_domain_id,
        bundle=make_bundle(tmp_path, LISTS, reads_sightings=True), camera="mast",
        bag=tmp_path / "bag", detector=str(NO_ERRORS),
    )  # fmt: skip
    with RosGraph(config) as graph:
        yield graph


def messages(bag: Path) -> dict[str, dict[int, Any]]:
    """Pictures, detections and decisions of a bag, by the stamp of the picture they are about."""
    found: dict[str, dict[int, Any]] = {IMAGE: {}, "/detections": {}, "/policy/decision": {}}
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            if connection.topic in found:
                message = reader.deserialize(data, connection.msgtype)
                decides = connection.topic == "/policy/decision"
                of = message.image_stamp if decides else message.header.stamp
                found[connection.topic][of.sec * 10**9 + of.nanosec] = message
    return found


def fault(graph: RosGraph, name: str, active: bool) -> None:
    client = graph.node.create_client(SetFault, "simulator/set_fault")
    client.wait_for_service()
    assert graph.call(client, SetFault.Request(fault=name, active=active), "the fault").ok


def test_it_drives_by_what_the_detector_says_and_not_when_that_means_nothing(
    graph: RosGraph, tmp_path: Path
) -> None:
    assert graph.start_episode(ROOM, "Sink", 0).ok
    outcome = graph.run_episode(ROOM, "Sink")
    assert (outcome.outcome, outcome.steps) == ("done", len(LISTS["Sink"]))

    fault(graph, "detections_other_labels", True)
    assert graph.start_episode(ROOM, "Sink", 0).ok
    with pytest.raises(
        GraphError,
        match="goal 'Sink': The labels do not fit the detector: found the",
    ):
        graph.run_episode(ROOM, "Sink")

    graph.close(keep_bag=True)
    said = messages(tmp_path / "bag")
    for message in said["/detections"].values():
        if "9999" not in str(message.detections[:1]):
            ids = [one.results[0].hypothesis.class_id for one in message.detections]
            assert all(0 <= int(number) < 38 for number in ids)
    assert len(said["/policy/decision"]) == len(LISTS["Sink"])
    assert said["/policy/decision"].keys() <= said["/detections"].keys()


@pytest.mark.parametrize("speed", [0.5, 0.0])
def test_a_detector_of_ones_own_drives_it(
    speed: float, tmp_path: Path, ros_domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that sees a cup in the middle of every picture, by its name.

    In lock-step every decision is made by what it says of the newest picture then.
    """
    for name in ("ROS_DOMAIN_ID", "ROS_LOG_DIR"):
        monkeypatch.setenv(name, os.environ.get(name, ""))
    column = np.zeros((1, 84, 1), np.float32)
    column[0, :4, 0] = 32, 32, 16, 16
    column[0, 4 + 41, 0] = 0.9
    model = constant_network(
        tmp_path / "cup.onnx", {"output0": column}, (1, 3, 64, 64), varies=1e-3
    )
    config = GraphConfig(
        ROOM, tmp_path / "logs", speed=speed, lock_step=speed == 0, domain=ros_domain_id,
        bundle=make_bundle(tmp_path, LISTS, reads_sightings=True), camera="mast",
        bag=tmp_path / "bag", detector=str(model),
    )  # fmt: skip
    with RosGraph(config) as graph:
        assert graph.start_episode(ROOM, "Sink", 0).ok
        assert graph.run_episode(ROOM, "Sink").outcome == "done"
    said = messages(tmp_path / "bag")
    decided, detected = said["/policy/decision"].keys(), said["/detections"].keys()
    assert len(decided) == len(LISTS["Sink"])
    assert decided <= detected
    if speed == 0:  # none was left out
        assert {t for t in said[IMAGE] if min(decided) <= t <= max(decided)} <= detected
    (one,) = said["/detections"][min(detected)].detections
    assert one.results[0].hypothesis.class_id == "cup"
    centre = one.bbox.center.position
    assert (centre.x, centre.y, one.bbox.size_x) == pytest.approx((150, 150, 75), abs=0.1)


def test_goals_are_those_that_bundle_and_labels_know(tmp_path: Path) -> None:
    checkpoint = save_fresh(tmp_path / "best.safetensors", "tdanet", None, ("Sink", "Towel"))
    export_bundle(checkpoint, None, tmp_path / "boxes", "boxes")
    config = DemoConfig(bundle=tmp_path / "boxes", camera="stock_wide")
    assert known_goals(config) == ("Sink", "Towel")
    assert known_goals(replace(config, goals="Fridge"))[-1] == "Fridge"  # it is zero-shot
    by_coco = replace(config, detector="any.onnx", labels="coco")
    assert known_goals(by_coco) == ("Sink",)
    with pytest.raises(GraphError, match="a detector with labels coco never says Towel"):
        known_goals(replace(by_coco, goals="Towel,Sink"))


def test_a_bundle_that_looks_rooms_up_is_told_which_one_it_drives_in(tmp_path: Path) -> None:
    by_room = DemoConfig(bundle=Path("lstde"))
    with pytest.raises(GraphError, match="in a type of room, and the rooms have several types"):
        known_goals(by_room)
    kitchens = replace(by_room, room="kitchen:25,sweet_home.kitchen:300")
    assert "Mug" in known_goals(kitchens)
    told = GraphConfig("kitchen:25", tmp_path, bundle=Path("lstde"), room_type=kitchens.room_type)
    assert told.parts[-1].parameters["room_type"] == "kitchen"
    assert DemoConfig().room_type == ""


def test_a_bag_with_detections_and_no_pictures_is_replayed(
    tmp_path: Path, ros_domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("ROS_DOMAIN_ID", "ROS_LOG_DIR"):
        monkeypatch.setenv(name, os.environ.get(name, ""))
    checkpoint = save_fresh(tmp_path / "best.safetensors", "tdanet", None, ("Sink",))
    export_bundle(checkpoint, None, tmp_path / "boxes", "boxes")
    config = GraphConfig(
        ROOM, tmp_path / "logs", speed=0, lock_step=True, domain=ros_domain_id,
        bundle=tmp_path / "boxes", camera="mast", bag=tmp_path / "bag", sample_seed=1,
        detector=str(NO_ERRORS),
    )  # fmt: skip
    with RosGraph(config) as graph:
        assert graph.start_episode(ROOM, "Sink", 1).ok
        steps = graph.run_episode(ROOM, "Sink", max_steps=8).steps
    assert steps > 1
    options = JudgeOptions(
        bundles={"boxes": str(tmp_path / "boxes")}, topics={"image": "/none"},
        robot=load_robot(), detections=DetectionSettings(labels=MOCK_LABELS),
    )  # fmt: skip
    judged = evaluate(config.bag, options)
    (drive,) = judged.drives
    assert "image" in judged.missing
    assert len(drive.steps) == steps
    for step in drive.steps:
        np.testing.assert_allclose(step.probabilities, step.driven_probabilities, atol=1e-3)
    assert max(step.detection_score for step in drive.steps) > 0

    pictures = evaluate(config.bag, replace(options, bundles={"default": "default"}))
    assert len(pictures.left_out) == steps
    assert all("holds no picture stamped" in left.reason for left in pictures.left_out)
