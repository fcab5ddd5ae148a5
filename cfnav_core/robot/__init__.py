"""What a robot is, as data that everybody reads.

Its topics, body, limits and LiDAR from one file a robot, and settings: frozen dataclasses as
parameters. `robots` holds the files that are shipped.

May import: nothing of the project.
"""
