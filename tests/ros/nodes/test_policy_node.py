"""Episodes of the policy node as a process, with real bundles, on a small exact robot."""

import math
import signal

import pytest

from cfnav_core.task.actions import Action
from cfnav_core.task.camera import MAST

pytestmark = pytest.mark.ros
pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from action_msgs.msg import GoalStatus  # noqa: E402
from cfnav_interfaces.action import NavigateToObject  # noqa: E402
from cfnav_interfaces.msg import EpisodeStatus  # noqa: E402
from cfnav_ros.drive.fields import stamp_to_ns  # noqa: E402
from cfnav_ros.ros.conversions import image_to_rgb  # noqa: E402
from geometry_msgs.msg import Twist  # noqa: E402
from rcl_interfaces.srv import GetParameters  # noqa: E402

from cfnav_core.policy.bundle import shipped_bundle, shipped_perception  # noqa: E402
from cfnav_core.policy.policy import Policy  # noqa: E402
from tests.ros.policy_graph import LATE_DEG, LATE_M, end_with, policy_graph, standing  # noqa: E402

ROUND = ("RotateLeft", "MoveAhead", "LookDown", "LookUp", "RotateRight", "Done")


@pytest.fixture
def graph(tmp_path, ros_domain_id):
    with policy_graph(tmp_path, ros_domain_id) as start:
        yield start


def test_another_camera_is_refused_unless_it_is_meant(graph, make_bundle):
    """40 degrees in place of the 90 that the bundle learnt from."""
    robot, process, _ = graph(make_bundle(*ROUND))
    robot.focal = 75 / math.tan(math.radians(20))
    status, result = robot.result(robot.send()[1])
    assert status == GoalStatus.STATUS_ABORTED
    assert "shows a view of 40 x 40 degrees in 150 x 150 pixels" in result.message
    assert "learnt from 90 x 90 degrees, 300 x 300 pixels, 1.3 m up" in result.message
    assert not robot.decisions
    assert end_with(process, signal.SIGINT) == 0


def test_another_camera_drives_when_it_is_meant(graph, make_bundle):
    robot, process, _ = graph(make_bundle("Done"), "other_camera:=true")
    robot.focal = 75 / math.tan(math.radians(20))
    assert robot.result(robot.send()[1])[1].outcome == "done"
    assert end_with(process, signal.SIGINT) == 0


def test_an_episode_from_goal_to_done(graph, make_bundle):
    robot, process, log = graph(make_bundle(*ROUND))
    status, result = robot.result(robot.send()[1])
    assert (status, result.outcome) == (GoalStatus.STATUS_SUCCEEDED, "done"), result.message
    assert (result.steps, result.vetoes, result.bumps) == (6, 0, 0)
    assert result.path_length == pytest.approx(0.25, abs=LATE_M)
    assert math.hypot(robot.x, robot.y) == pytest.approx(0.25, abs=LATE_M)
    assert math.degrees(robot.yaw) == pytest.approx(0.0, abs=LATE_DEG)
    robot.wait(lambda: standing(robot), "the robot to stand")
    assert robot.tilt == MAST.horizons[0]

    reports = (robot.statuses, robot.decisions, robot.feedback)

    def counts():
        return [len(r) for r in reports]

    robot.wait(lambda: counts() == [2, 6, 6], lambda: f"2, 6 and 6 reports, heard {counts()}")
    assert [Action(d.action).name for d in robot.decisions] == list(ROUND)
    assert [f.action for f in robot.feedback] == list(ROUND)
    assert [d.step for d in robot.decisions] == [1, 2, 3, 4, 5, 6]
    assert all(d.collision_probability == pytest.approx(0.1) for d in robot.decisions)
    begun, ended = robot.statuses
    assert (begun.phase, begun.goal, begun.outcome) == (EpisodeStatus.STARTED, "Laptop", "")
    assert (ended.phase, ended.outcome, ended.steps) == (EpisodeStatus.ENDED, "done", 6)
    assert ended.bundle == "-".join(ROUND)

    # The same policy on the same pictures gives the same answers as the node did.
    policy = Policy.load(make_bundle(*ROUND))
    policy.reset("Laptop")
    for decision in robot.decisions:
        picture = image_to_rgb(robot.pictures[stamp_to_ns(decision.image_stamp)])
        again = policy.act(picture, decision.collision_probability)
        assert int(again.action) == decision.action
        assert decision.action_probabilities == pytest.approx(again.probabilities, abs=1e-6)
        assert decision.detection_score == pytest.approx(again.detection_score, abs=1e-6)

    asked = robot.node.create_client(GetParameters, "policy_node/get_parameters")
    robot.wait(asked.service_is_ready, "the parameter service")
    answer = asked.call_async(GetParameters.Request(names=["episode.motion.v_max"]))
    robot.wait(answer.done, "a parameter")
    assert answer.result().values[0].double_value == 0.2

    text = log.read_text()
    assert f"Bundle {'-'.join(ROUND)} drives" in text
    assert "Goals: Laptop, Mug." in text
    assert "Sending TwistStamped to /cmd_vel." in text
    assert end_with(process, signal.SIGINT) == 0
    assert "Traceback" not in log.read_text()


def test_torch_runs_the_shipped_bundle(graph):
    pytest.importorskip("torch", reason="torch is not installed: run 'make setup-test'")
    robot, _, log = graph(shipped_bundle(), "backend:=torch")
    _, result = robot.result(robot.send(max_steps=1)[1])
    assert result.steps == 1, result.message
    robot.wait(lambda: robot.decisions, "the decision")
    (decision,) = robot.decisions
    policy = Policy.load(shipped_bundle(), "torch")
    policy.reset("Laptop")
    picture = image_to_rgb(robot.pictures[stamp_to_ns(decision.image_stamp)])
    again = policy.act(picture, decision.collision_probability)
    assert decision.action_probabilities == pytest.approx(again.probabilities, abs=1e-5)
    assert "drives, run by torch." in log.read_text()


def test_actions_are_drawn_when_asked(graph, tmp_path):
    pytest.importorskip("torch", reason="torch is not installed: run 'make setup-test'")
    from cfnav_core.learn.export import export_bundle
    from tests.core.model_samples import save_fresh

    perception = shipped_perception()
    # untrained, so that no action is sure
    checkpoint = save_fresh(tmp_path / "fresh.safetensors", "tdanet", perception, ("Laptop",))
    export_bundle(checkpoint, perception, tmp_path / "fresh", "fresh")
    robot, _, log = graph(tmp_path / "fresh", "sample_seed:=3")
    _, result = robot.result(robot.send(max_steps=8)[1])
    robot.wait(lambda: len(robot.decisions) == result.steps, "the decisions")
    policy = Policy.load(tmp_path / "fresh", sample_seed=3)
    policy.reset("Laptop")
    probable = []
    for decision in robot.decisions:
        picture = image_to_rgb(robot.pictures[stamp_to_ns(decision.image_stamp)])
        again = policy.act(picture, decision.collision_probability)
        assert int(again.action) == decision.action
        probable.append(int(again.probabilities.argmax()) == decision.action)
    assert not all(probable)
    assert "actions drawn with seed 3" in log.read_text()


def test_limits_vetoes_bumps_and_refusals(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"), "episode.max_steps:=2")
    _, result = robot.result(robot.send()[1])
    assert (result.outcome, result.steps) == ("step_limit", 2)
    assert robot.x == pytest.approx(0.5, abs=2 * LATE_M)
    status, result = robot.result(robot.send(max_steps=1)[1])
    assert (status, result.steps) == (GoalStatus.STATUS_ABORTED, 1)

    robot.probability, robot.clearance = 0.9, 0.1
    x = robot.x
    _, result = robot.result(robot.send(max_steps=4)[1])
    assert (result.outcome, result.steps, result.vetoes) == ("step_limit", 4, 4)
    assert robot.x == x
    robot.wait(lambda: len(robot.decisions) == 7, "the decisions")
    assert all(d.vetoed for d in robot.decisions[-4:])
    robot.probability, robot.clearance = 0.1, 2.0

    future = robot.send(max_steps=1)[1]
    robot.wait_driving()
    robot.bumping = True
    _, result = robot.result(future)
    robot.bumping = False
    assert (result.outcome, result.bumps) == ("step_limit", 1)

    _, result = robot.result(robot.send("Unicorn")[1])
    assert result.outcome == "refused"
    assert result.message == (
        "The policy does not take this goal: found goal 'Unicorn', expected one of Laptop, Mug."
    )
    robot.encoding = "yuv422"
    seen = len(robot.pictures)
    robot.wait(lambda: len(robot.pictures) > seen + 3, "pictures of the other encoding")
    _, result = robot.result(robot.send()[1])
    assert result.outcome == "refused"
    assert "encoded as 'yuv422', expected one of rgb8" in result.message


def test_cancel_preempt_and_time_limit(graph, make_bundle):
    robot, _, _ = graph(make_bundle("MoveAhead"))
    handle, future = robot.send()
    robot.wait_driving()
    handle.cancel_goal_async()
    status, result = robot.result(future)
    assert (status, result.outcome) == (GoalStatus.STATUS_CANCELED, "canceled")
    robot.wait(lambda: standing(robot), "the robot to stand")

    first = robot.send("Laptop")[1]
    robot.wait_driving()
    second = robot.send("Mug", time_limit=3.0)[1]
    third = robot.send("Laptop", time_limit=3.0)[1]
    for future in (first, second):
        status, result = robot.result(future)
        assert (status, result.outcome) == (GoalStatus.STATUS_ABORTED, "preempted")
    status, result = robot.result(third)
    assert (result.outcome, result.message) == ("time_limit", "3 s have passed.")
    robot.wait(lambda: standing(robot), "the robot to stand")


def test_a_flood_of_goals_leaves_one_that_is_served(graph, make_bundle):
    """One is served and one waits; of the others a client hears little, as services keep ten."""
    robot, _, _ = graph(make_bundle("MoveAhead"))
    first = robot.send()[1]
    robot.wait_driving()
    goal = NavigateToObject.Goal(goal="Mug")
    robot.done(lambda: [robot.client.send_goal_async(goal) for _ in range(1000)])
    last = robot.send("Laptop", max_steps=1)[1]
    _, result = robot.result(first)
    assert result.outcome == "preempted", result.message
    _, result = robot.result(last)
    assert (result.outcome, result.steps) == ("step_limit", 1), result.message
    robot.wait(lambda: standing(robot), "the robot to stand")


def test_twist_is_sent_to_who_listens_to_twist(graph, make_bundle):
    robot, _, log = graph(make_bundle("RotateLeft"), velocity=Twist)
    _, result = robot.result(robot.send(max_steps=1)[1])
    assert result.outcome == "step_limit"
    assert math.degrees(robot.yaw) == pytest.approx(45, abs=LATE_DEG)
    assert "Sending Twist to /cmd_vel." in log.read_text()
