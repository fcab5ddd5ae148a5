"""Learning and deciding: task, scenes, models, training, and the policy that a robot runs.

Knows no ROS and no simulator. The folders below say what each of them holds and may import.
"""

__version__ = "0.1.0"
