"""May the policy drive what listens on cmd_vel, and why does an input not come?

Pure: who is on a topic is an argument.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

STAMPED = "geometry_msgs/msg/TwistStamped"
UNSTAMPED = "geometry_msgs/msg/Twist"
TYPES = {"stamped": STAMPED, "unstamped": UNSTAMPED}

MOCK = "mock_turtlebot4"
"""Node name of the simulated base, the only one that may be driven without ``allow_robot``."""

RECORDERS = ("recorder", "rosbag2_recorder")
"""Names of the nodes that record: cfnav's and that of `ros2 bag record`."""

ONLOOKERS = (*RECORDERS, "foxglove_bridge")
"""Nodes that listen to everything and drive nothing."""

COMMAND_LINE = "_ros2cli_"
"""How the names of nodes begin that `ros2 topic echo` and its like make; they only listen."""

UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"
"""What discovery says of an endpoint whose node it has not heard of yet."""


@dataclass(frozen=True)
class Endpoint:
    """A subscriber of a topic: the name of its node and its message type."""

    node: str
    type: str


@dataclass(frozen=True)
class Source:
    """A publisher of an input: its node, its message type, and where its QoS clashes with ours."""

    node: str
    type: str
    clash: str = ""


def explain_silence(
    topic: str, expected: str, sources: Sequence[Source], relatives: Sequence[str] = ()
) -> str:
    """Say why nothing arrives, as part of a sentence; empty when there is no reason to see.

    Args:
        topic: resolved name of the input.
        expected: message type that is listened for, such as sensor_msgs/msg/Image.
        sources: who publishes the topic, in whatever type.
        relatives: names of topics below it, such as that of compressed pictures.
    """
    if not sources:
        only = f", only {', '.join(sorted(relatives))}" if relatives else ""
        return f"nobody publishes {topic}{only}"
    fitting = [source for source in sources if source.type == expected]
    if not fitting:
        found = sorted({f"{source.node} sends {source.type}" for source in sources})
        return f"{', '.join(found)} on {topic}, expected {expected}"
    if all(source.clash for source in fitting):
        return f"{fitting[0].node} offers {topic} with other QoS: {fitting[0].clash}"
    return ""


@dataclass(frozen=True)
class BaseCheck:
    """What is known of the base: ``fault`` forbids driving for good, ``waiting`` only so far.

    ``type`` is the message type to send when neither is set; ``deaf`` says that nobody listens, or
    that nobody knows yet who else drives: a robot on its way stops.
    """

    type: str = ""
    waiting: str = ""
    fault: str = ""
    deaf: bool = False

    @property
    def ready(self) -> bool:
        """Whether the base may be driven now."""
        return not (self.waiting or self.fault)


def check_base(
    topic: str,
    subscribers: Sequence[Endpoint],
    other_publishers: Mapping[str, Sequence[str]],
    cmd_vel_type: str = "auto",
    allow_robot: bool = False,
    other_publishers_allowed: Sequence[str] = (),
) -> BaseCheck:
    """Decide whether and with which message type to drive.

    Args:
        topic: resolved name of the velocity topic, for the sentences.
        subscribers: who listens on it.
        other_publishers: names of other nodes that publish on it, or on another topic that moves
            the base, by topic.
        cmd_vel_type: auto, stamped or unstamped.
        allow_robot: whether anything but the mock may be driven.
        other_publishers_allowed: nodes that may publish beside us, such as a joystick's that
            speaks only while its deadman button is held.

    Returns:
        The message type, or one sentence why not (yet).
    """
    for rivaled, publishers in other_publishers.items():
        rivals = sorted(set(publishers) - set(other_publishers_allowed))
        if rivals == [UNKNOWN_NODE]:
            return BaseCheck(waiting=f"A publisher on {rivaled} has not said its name.", deaf=True)
        if rivals:
            found = f"{', '.join(rivals)} also publishes on {rivaled}"
            return BaseCheck(fault=f"{found}: stop it, one node must drive.")
    bases = [s for s in subscribers if not only_listens(s.node)]
    if not bases:
        return BaseCheck(waiting=f"No robot listens on {topic}.", deaf=True)
    if any(base.node == UNKNOWN_NODE for base in bases):
        return BaseCheck(waiting=f"A listener on {topic} has not said its name.")
    robots = sorted({base.node for base in bases} - {MOCK})
    if robots and not allow_robot:
        return BaseCheck(
            fault=f"{', '.join(robots)} listens on {topic} and may be a real robot: set "
            "allow_robot to drive it."
        )
    return _choose_type(topic, {base.type for base in bases}, cmd_vel_type)


def only_listens(node: str) -> bool:
    """Whether a node of this name is known to drive nothing."""
    return node in ONLOOKERS or node.startswith(COMMAND_LINE)


def _choose_type(topic: str, types: set[str], wanted: str) -> BaseCheck:
    found = ", ".join(sorted(types))
    if len(types) > 1:
        return BaseCheck(fault=f"Listeners on {topic} want different types ({found}).")
    if found not in TYPES.values():
        return BaseCheck(fault=f"The listener on {topic} wants {found}, expected {STAMPED}.")
    if wanted != "auto" and TYPES[wanted] != found:
        return BaseCheck(
            fault=f"cmd_vel_type is {wanted}, but the listener on {topic} wants {found}: set it to "
            "auto."
        )
    return BaseCheck(type=found)
