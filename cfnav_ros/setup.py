"""Lets colcon build this package; pip uses the pyproject.toml of the repository."""

from setuptools import find_packages, setup

PACKAGE = "cfnav_ros"
EXECUTABLES = (
    "policy_node", "lidar_collision_node", "recorder_node", "bringup", "lidar_mask", "markers_node",
    "bag_eval", "bag_play", "demo",
)  # fmt: skip

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=find_packages(),
    package_data={PACKAGE: ["config/*", "templates/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    entry_points={"console_scripts": [f"{name} = {PACKAGE}.{name}:main" for name in EXECUTABLES]},
    install_requires=["setuptools"],
    zip_safe=False,
)
