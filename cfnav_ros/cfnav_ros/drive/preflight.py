"""May the policy drive what listens on cmd_vel, and why does an input not come?

Pure: who is on a topic is an argument.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cfnav_core.robot.topics import STAMPED, UNSTAMPED
from cfnav_ros.robot.speakers import UNKNOWN_NODE

TYPES = {"stamped": STAMPED, "unstamped": UNSTAMPED}

MOCK = "mock_turtlebot4"
"""Node name of the simulated base, the only one that may be driven without ``allow_robot``."""

RECORDERS = ("recorder", "rosbag2_recorder")
"""Names of the nodes that record: cfnav's and that of `ros2 bag record`."""

ONLOOKERS = (*RECORDERS, "foxglove_bridge")
"""Nodes that listen to everything and drive nothing."""

COMMAND_LINE = "_ros2cli_"
"""How the names of nodes begin that `ros2 topic echo` and its like make; they only listen."""


@dataclass(frozen=True)
class Endpoint:
    """A subscriber of a topic: the name of its node and its message type."""

    node: str
    type: str


@dataclass(frozen=True)
class InputPublisher:
    """A publisher of an input: its node, its message type, and where its QoS clashes with ours."""

    node: str
    type: str
    clash: str = ""


def relatives(topic: str, names: Sequence[str]) -> list[str]:
    """Of the graph's topics those below one or above: of pictures the compressed, or the raw."""
    return [n for n in names if n.startswith(f"{topic}/") or topic.startswith(f"{n}/")]


def explain_silence(
    topic: str, expected: str, sources: Sequence[InputPublisher], near: Sequence[str] = ()
) -> str:
    """Say why nothing arrives, as part of a sentence; empty when there is no reason to see.

    Args:
        topic: resolved name of the input.
        expected: message type that is listened for, such as sensor_msgs/msg/Image.
        sources: who publishes the topic, in whatever type.
        near: names of topics that may be meant, see ``relatives``.
    """
    if not sources:
        only = f", only {', '.join(sorted(near))}" if near else ""
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

    ``type`` is the message type to send when neither is set; ``deaf`` says that somebody who
    must listen does not, or that nobody knows yet who else drives: a robot on its way stops.
    """

    type: str = ""
    waiting: str = ""
    fault: str = ""
    deaf: bool = False

    @property
    def ready(self) -> bool:
        """Whether the base may be driven now."""
        return not (self.waiting or self.fault)


def hidden(environment: Mapping[str, str]) -> str:
    """One sentence when these settings hide from a node who else is on its topics, else empty.

    Through a discovery server a Fast DDS client hears only of endpoints that match its own, so it
    sees neither what listens on cmd_vel before it publishes there, nor rivals (ros2/ros2 #1596).
    """
    client = environment.get("ROS_DISCOVERY_SERVER", "").strip(";")
    if not client or environment.get("ROS_SUPER_CLIENT", "").lower() in ("true", "1"):
        return ""
    return (
        "ROS_DISCOVERY_SERVER is set without ROS_SUPER_CLIENT, so that this node does not see who "
        "else drives: `export ROS_SUPER_CLIENT=True` and start it again."
    )


def check_base(
    topic: str,
    subscribers: Sequence[Endpoint],
    other_publishers: Mapping[str, Sequence[str]],
    cmd_vel_type: str = "auto",
    allow_robot: bool = False,
    other_publishers_allowed: Sequence[str] = (),
    listened_to: Sequence[str] = (),
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
        listened_to: topics of the same kind that somebody listens to, such as those of robots in
            other namespaces.

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
        near = sorted(set(listened_to) - {topic})
        there = f", but somebody does on {', '.join(near)}: set the namespace" if near else ""
        return BaseCheck(waiting=f"No robot listens on {topic}{there}.", deaf=True)
    if any(base.node == UNKNOWN_NODE for base in bases):
        return BaseCheck(waiting=f"A listener on {topic} has not said its name.")
    robots = sorted({base.node for base in bases} - {MOCK})
    if robots and not allow_robot:
        return BaseCheck(
            fault=f"{', '.join(robots)} listens on {topic} and may be a real robot: set "
            "allow_robot to drive it."
        )
    return _choose_type(topic, {base.type for base in bases}, cmd_vel_type)


def check_mux(
    topic: str, subscribers: Sequence[Endpoint], base_topic: str, publishers: Sequence[str]
) -> BaseCheck:
    """Decide whether and with which message type to send to a multiplexer of velocities.

    Args:
        topic: resolved name of its input.
        subscribers: who listens there.
        base_topic: resolved name of the topic that the base listens to.
        publishers: names of other nodes that publish there.

    Returns:
        The message type, or one sentence why not yet.
    """
    muxes = [s for s in subscribers if not only_listens(s.node)]
    if not muxes:
        return BaseCheck(waiting=f"No multiplexer listens on {topic}.", deaf=True)
    if not publishers:
        return BaseCheck(waiting=f"No multiplexer publishes on {base_topic}.", deaf=True)
    if any(mux.node == UNKNOWN_NODE for mux in muxes):
        return BaseCheck(waiting=f"A listener on {topic} has not said its name.")
    return _choose_type(topic, {mux.type for mux in muxes}, "auto")


def check_recorder(
    base: BaseCheck, topic: str, listeners: Sequence[Endpoint], matched: bool
) -> BaseCheck:
    """Let a base that may be driven wait for a recorder.

    Args:
        base: what is known of it otherwise.
        topic: resolved name of its topic.
        listeners: who listens there.
        matched: whether all of them hear what is sent now.
    """
    recorded = any(listener.node in RECORDERS for listener in listeners)
    if recorded and matched:
        return base
    # One that is gone stops a robot on its way; others that join are matched in a moment.
    return BaseCheck(waiting=f"No recorder hears {topic}.", deaf=not recorded)


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
