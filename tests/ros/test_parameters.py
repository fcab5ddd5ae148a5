"""Dataclass <-> ROS parameters."""

from dataclasses import dataclass, field

import pytest

pytestmark = pytest.mark.ros
rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_ros.parameters import LidarParameters, PolicyParameters, declare  # noqa: E402
from rclpy.node import Node  # noqa: E402


@dataclass(frozen=True)
class Inner:
    depth: int = field(default=3, metadata={"help": "how deep"})


@dataclass(frozen=True)
class Outer:
    speed: float = field(default=0.5, metadata={"help": "how fast, m/s"})
    name: str = field(default="x", metadata={"help": "who"})
    inner: Inner = field(default_factory=Inner)

    def __post_init__(self):
        if self.speed < 0:
            raise ValueError(f"speed is {self.speed}, expected a positive number.")


@pytest.fixture
def read():
    """Declare a dataclass on a node that was given some arguments."""
    context = rclpy.Context()
    nodes = []

    def read(kind, *arguments, name="a_node"):
        rclpy.init(args=["--ros-args", *arguments], context=context)
        nodes.append(
            Node(name, context=context, automatically_declare_parameters_from_overrides=True)
        )
        return declare(nodes[0], kind), nodes[0]

    yield read
    for node in nodes:
        node.destroy_node()
    context.try_shutdown()


def test_defaults_and_descriptions_come_from_the_dataclass(read):
    values, node = read(Outer)
    assert values == Outer()
    assert node.get_parameter("inner.depth").value == 3
    assert node.describe_parameter("speed").description == "how fast, m/s"
    assert node.describe_parameter("speed").read_only


def test_values_given_are_taken(read):
    values, _ = read(Outer, "-p", "speed:=2", "-p", "inner.depth:=7", "-p", "name:=bob")
    assert values == Outer(2.0, "bob", Inner(7))


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ("sped:=1.0", "There is no parameter 'sped'; there are speed, name, inner.depth."),
        ("speed:=fast", "speed is 'fast', expected float, such as 0.5."),
        ("inner.depth:=1.5", r"inner.depth is 1.5, expected int, such as 3."),
        ("speed:=-1.0", "speed is -1.0, expected a positive number."),
        ("use_sim_time:=3", "use_sim_time is 3, expected bool"),
    ],
)
def test_bad_values_give_one_sentence(read, given, sentence):
    with pytest.raises(ValueError, match=sentence):
        read(Outer, "-p", given)


def test_bad_choices_are_refused():
    with pytest.raises(ValueError, match="cmd_vel_type is 'both'"):
        PolicyParameters(cmd_vel_type="both")
    with pytest.raises(ValueError, match=r"rate is 1\.0"):
        PolicyParameters(rate=1.0)
    with pytest.raises(ValueError, match="stale is 0"):
        LidarParameters(stale=0)
