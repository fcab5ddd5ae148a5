"""Replaying what a robot recorded."""

from cfnav_ros.bags.files.events import Decided
from cfnav_ros.bags.replay.estimates import Estimates
from cfnav_ros.bags.replay.replay import Replay
from cfnav_ros.drive.limits import EpisodeLimits

S = 1_000_000_000
WITHOUT_LIDAR = EpisodeLimits(p_hat="own", veto=False)


def replay(events, policies, **options):
    estimates = Estimates()
    policies = policies if isinstance(policies, dict) else {"restless": policies}
    run = Replay(policies, estimates, **options)
    for event in events:
        estimates.see(event)
        run.see(event)
    run.finish()
    return run


def decisions(events):
    return [event for event in events if isinstance(event, Decided)]
