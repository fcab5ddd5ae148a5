"""Perception networks judged on pictures."""
