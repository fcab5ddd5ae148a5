"""Lets colcon build this package; pip uses the pyproject.toml of the repository."""

from setuptools import find_packages, setup

PACKAGE = "cfnav_ros"
EXECUTABLES = {
    "policy_node": "ros", "lidar_collision_node": "ros", "recorder_node": "ros",
    "markers_node": "ros", "detector_node": "ros", "bag_play": "ros", "bringup": "live",
    "demo": "live", "bag_eval": "report", "lidar_mask": "bags",
}  # fmt: skip
"""Name of each executable to the folder of its module."""

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=find_packages(),
    package_data={PACKAGE: ["config/*", "report/templates/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    entry_points={
        "console_scripts": [
            f"{name} = {PACKAGE}.{folder}.{name}:main" for name, folder in EXECUTABLES.items()
        ]
    },
    install_requires=["setuptools"],
    zip_safe=False,
)
