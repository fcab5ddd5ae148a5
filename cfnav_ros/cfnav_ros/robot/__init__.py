"""What comes from a robot before anything is driven: stamps, pictures and depths of its messages.

What the robot itself is, is data in `cfnav_core.robot`.

May import: cfnav_core.task.
"""
