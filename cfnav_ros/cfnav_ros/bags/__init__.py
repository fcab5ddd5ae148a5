"""Recorded drives: read as typed events, judged, replayed, shown. Needs no ROS."""
