"""Bundles of real networks that have learnt nothing, as the tests of the ROS graph use them."""

from tests.ros.conftest import eager_bundle, make_bundle

__all__ = ["eager_bundle", "make_bundle"]
