"""Studies of the paper and benchmarks. They need a checkout: nothing here is in the wheel.

May import: cfnav_core.files, cfnav_ros.process.
"""
