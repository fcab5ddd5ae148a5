"""Files on disk.

Written whole or not at all, JSON, JSON lines, tensors, locks, and which commit made them.

Knows nothing of robots.

May import: torch.
"""
