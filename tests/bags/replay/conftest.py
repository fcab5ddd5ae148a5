"""A restless bundle and its recorded drives."""

import pytest

from cfnav_core.policy.policy import Policy
from tests.bags.live_drives import RecordedRobot, restless_bundle


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    return restless_bundle(tmp_path_factory.mktemp("bundle"))


@pytest.fixture(scope="module")
def policy(bundle):
    return Policy.load(bundle)


@pytest.fixture(scope="module")
def recorded(bundle):
    """Three drives with the LiDAR, and how they went."""
    robot, live = RecordedRobot(seed=1), Policy.load(bundle)
    episodes = [robot.drive(live, goal, max_steps=15) for goal in ("Mug", "Laptop", "Mug")]
    return robot.events, episodes
