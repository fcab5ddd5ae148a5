"""A person who drives a robot and the strangers who end it, behind a discovery server.

A program of its own, as Fast DDS keeps to the first discovery server that a process has met:
``python -m tests.ros.live.people_behind_a_server SERVER DOMAIN ANOTHER_DOMAIN`` prints a line of
JSON for each goal that ended: its outcome, its message and the way in metres.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable

from cfnav_interfaces.action import NavigateToObject
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan

from tests.ros.own_node import OwnNode

UNANSWERED_S = 5.0
"""After so long a goal is sent again, in place of the one before: the policy node's answer is lost
where it has yet to discover the client."""


class Person(OwnNode):
    """Somebody who sends goals from the computer and sees how the robot turns."""

    def __init__(self, domain: int) -> None:
        super().__init__(domain, "person")
        self.turns = 0.0
        self.client = ActionClient(self.node, NavigateToObject, "navigate_to_object")
        self.node.create_subscription(Odometry, "odom", self._on_odometry, qos_profile_sensor_data)

    def _on_odometry(self, message: Odometry) -> None:
        self.turns = message.twist.twist.angular.z

    def send(self, max_steps: int) -> Callable[[], NavigateToObject.Result]:
        """Sends a goal; returns a function that waits for its result."""
        self.wait(self.client.server_is_ready, "the action server")
        goal = NavigateToObject.Goal(goal="Laptop", max_steps=max_steps)
        sent = [self.client.send_goal_async(goal)]
        began = time.monotonic()

        def send_again() -> None:
            if time.monotonic() - began > len(sent) * UNANSWERED_S:
                sent.append(self.client.send_goal_async(goal))

        self.wait(lambda: sent[-1].done(), "the goal to be accepted", send_again)
        ended = sent[-1].result().get_result_async()

        def result() -> NavigateToObject.Result:
            self.wait(ended.done, "the result")
            return ended.result().result

        return result


def say(ended: NavigateToObject.Result) -> None:
    """Prints what the test reads."""
    print(json.dumps([ended.outcome, ended.message, ended.path_length]), flush=True)


def main() -> None:
    """Sends goals; strangers, plain clients of the server in any domain, end all but the first."""
    server, domain, another = sys.argv[1], *map(int, sys.argv[2:])
    # given by hand: whatever imports the tests is kept off a server that the shell names
    os.environ |= {"ROS_DISCOVERY_SERVER": server, "ROS_SUPER_CLIENT": "True"}
    person = Person(domain)
    say(person.send(max_steps=2)())
    os.environ["ROS_SUPER_CLIENT"] = "False"
    for where, kind, topic in ((domain, TwistStamped, "cmd_vel"), (another, LaserScan, "scan")):
        rival = OwnNode(where, "rival")
        person.turns = 0.0
        goal = person.send(max_steps=5000)
        person.wait(lambda: person.turns > 0.3, "the robot to turn")
        publisher = rival.node.create_publisher(kind, topic, 1)
        say(goal())
        rival.node.destroy_publisher(publisher)
        rival.close()
    person.close()


if __name__ == "__main__":
    main()
