"""What the policy node hears, and what it asks the graph."""

from collections import Counter

import pytest

pytestmark = pytest.mark.ros
rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_ros.limits import EpisodeLimits  # noqa: E402
from cfnav_ros.policy_parameters import PolicyParameters  # noqa: E402
from cfnav_ros.preflight import BaseCheck  # noqa: E402
from cfnav_ros.senses import Senses  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402


@pytest.fixture
def node(ros_domain_id):
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain_id)
    node = rclpy.create_node("policy_node", context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


@pytest.mark.parametrize(("lidar", "tilt"), [(False, False), (True, False), (True, True)])
def test_the_graph_is_asked_for_what_is_needed_and_has_not_come(node, lidar, tilt):
    limits = EpisodeLimits(p_hat="lidar" if lidar else "own", veto=lidar, has_tilt=tilt)
    senses = Senses(node, PolicyParameters(episode=limits), lambda: None)
    senses.notice_base(BaseCheck())
    asked = {"frame", "odometry", *["estimate"] * lidar, *["tilt"] * tilt}
    assert set(senses.inputs.notes) == asked
    assert senses.inputs.notes["odometry"] == "nobody publishes /odom"


@pytest.mark.parametrize("lock_step", [False, True])
def test_in_lock_step_odometry_and_joints_wake_too(node, lock_step):
    woken = Counter()
    settings = PolicyParameters(lock_step=lock_step)
    senses = Senses(node, settings, lambda: woken.update(["wake"]))
    senses._on_odometry(Odometry())
    senses._on_joints(JointState(name=["camera_tilt"], position=[0.0]))
    assert woken["wake"] == 2 * lock_step
    assert senses.heard == {"odometry", "tilt"}
