"""Lets colcon build this package; pip uses the pyproject.toml of the repository."""

from setuptools import find_packages, setup

PACKAGE = "sim_bridge"
EXECUTABLES = {"mock_turtlebot4": "ros", "dataset": "data"}
"""Name of each executable to the folder of its module."""


setup(
    name=PACKAGE,
    version="0.1.0",
    packages=find_packages(),
    package_data={PACKAGE: ["sweet_home/models.yaml", "sweet_home/cc0/*"]},
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
