"""Dataclass <-> ROS parameters."""

from dataclasses import dataclass, field

import pytest

pytestmark = pytest.mark.ros
rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_ros.drive.policy_parameters import PolicyParameters  # noqa: E402
from cfnav_ros.lidar.scan_watch import LidarParameters  # noqa: E402
from cfnav_ros.ros.parameters import declare  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402

from cfnav_core.robot.settings import OF_RCLPY  # noqa: E402


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
        return declare(nodes[0], kind()), nodes[0]

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


@dataclass(frozen=True)
class Ranged:
    share: float = field(
        default=0.5, metadata={"help": "a part", "min": 0.0, "max": 1.0, "live": True}
    )
    steps: int = field(default=3, metadata={"min": 1})
    most: float = field(default=3.0, metadata={"max": 9.0})

    def __post_init__(self):
        if self.share == 0.25:
            raise ValueError("share is 0.25, expected another.")


def test_ranges_are_described_and_held(read):
    values, node = read(Ranged, "-p", "steps:=7")
    assert values == Ranged(steps=7)
    (share,) = node.describe_parameter("share").floating_point_range
    assert (share.from_value, share.to_value) == (0.0, 1.0)
    (steps,) = node.describe_parameter("steps").integer_range
    assert (steps.from_value, steps.to_value) == (1, 2**31 - 1)
    assert node.describe_parameter("steps").read_only


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ("share:=1.5", "share is 1.5, expected 0 to 1."),
        ("share:=.nan", "share is nan, expected 0 to 1."),
        ("steps:=0", "steps is 0, expected at least 1."),
        ("most:=9.5", "most is 9.5, expected at most 9."),
    ],
)
def test_values_out_of_range_give_one_sentence(read, given, sentence):
    with pytest.raises(ValueError, match=sentence):
        read(Ranged, "-p", given)


def test_live_parameters_can_be_changed_and_others_not():
    context, heard = rclpy.Context(), []
    rclpy.init(args=[], context=context)
    node = Node("a_node", context=context, automatically_declare_parameters_from_overrides=True)
    declare(node, Ranged(), heard.append)

    def change(**given):
        return node.set_parameters([Parameter(name, value=v) for name, v in given.items()])[0]

    assert change(share=0.75).successful
    assert change(share=1).successful  # a whole number will do
    assert heard == [Ranged(share=0.75), Ranged(share=1.0)]
    for given, reason in (
        ({"share": 0.25}, "share is 0.25, expected another."),
        ({"share": "x"}, "share is 'x', expected float, such as 0.5."),
    ):
        refused = change(**given)
        assert (refused.successful, refused.reason) == (False, reason)
    assert not change(share=2.0).successful
    assert not change(steps=4).successful
    assert len(heard) == 2
    assert node.get_parameter("share").value == 1
    node.destroy_node()
    context.shutdown()


@pytest.mark.parametrize("kind", [PolicyParameters, LidarParameters])
def test_defaults_lie_within_their_ranges_and_every_field_has_help(read, kind):
    values, node = read(kind)
    assert values == kind()
    names = [name for name in node.get_parameters_by_prefix("") if name not in OF_RCLPY]
    assert all(node.describe_parameter(name).description for name in names)


def test_bad_choices_are_refused():
    with pytest.raises(ValueError, match="cmd_vel_type is 'both'"):
        PolicyParameters(cmd_vel_type="both")
    with pytest.raises(ValueError, match="backend is 'tf'"):
        PolicyParameters(backend="tf")
    with pytest.raises(ValueError, match="mount is 'both', expected auto, tf, parameters"):
        LidarParameters(mount="both")
