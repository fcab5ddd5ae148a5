"""What can go wrong, as a table: scans, pictures, messages, clocks, and when it holds.

May import: sim_bridge.robot.
"""
