"""How a node is served in a thread, and how it leaves its domain."""

from __future__ import annotations

import gc
import threading
from collections.abc import Iterator

import pytest

pytestmark = pytest.mark.ros

pytest.importorskip("rclpy", reason="ROS 2 is not installed: run 'make setup'")
pytest.importorskip("cfnav_interfaces", reason="ros_ws is not built: run 'make setup'")

from cfnav_interfaces.action import NavigateToObject  # noqa: E402
from cfnav_ros.ros.spinning import SpinningThread  # noqa: E402
from rclpy.action import ActionClient  # noqa: E402

from tests.conftest import DEADLINE_S  # noqa: E402
from tests.ros.own_node import OwnNode  # noqa: E402


@pytest.fixture
def without_collector() -> Iterator[None]:
    """Nothing is destroyed by Python's collector, whose turn nobody can foretell."""
    gc.disable()
    yield
    gc.enable()


@pytest.mark.usefixtures("without_collector")
def test_a_node_with_an_action_client_is_gone_at_once(ros_domain_id: int) -> None:
    watcher, client = OwnNode(ros_domain_id, "watcher"), OwnNode(ros_domain_id, "client")
    kept = ActionClient(client.node, NavigateToObject, "navigate_to_object")

    def seen() -> bool:
        return "client" in watcher.node.get_node_names()

    watcher.wait(seen, "the client to be seen")
    client.close()
    watcher.wait(lambda: not seen(), "the client to be gone")
    watcher.close()
    del kept


def test_a_thread_whose_node_has_nothing_to_do_can_be_ended(ros_domain_id: int) -> None:
    own = OwnNode(ros_domain_id, "idle")
    thread = SpinningThread(own.node)
    thread.daemon = True
    thread.start()
    ending = threading.Thread(target=thread.end, daemon=True)
    ending.start()
    ending.join(DEADLINE_S)
    assert not thread.is_alive()
    own.close()
