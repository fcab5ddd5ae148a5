"""Bags made, damaged, read and judged: speed, memory, agreement with live drives.

May import: cfnav_core, cfnav_ros, studies, studies.deploy.
"""
