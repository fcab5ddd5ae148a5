"""Rows x training seeds x tests, here or on Ray, going on where they stopped: what studies share.

May import: cfnav_core, torch, ray.
"""
