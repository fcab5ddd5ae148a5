"""Offline scenes: every state of a room as arrays, many rooms as one store, and checks of both.

May import: cfnav_core.files, cfnav_core.task.
"""
