"""Lets colcon build this package; pip uses the pyproject.toml of the repository."""

from setuptools import find_packages, setup

PACKAGE = "cfnav_core"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=[PACKAGE, *(f"{PACKAGE}.{name}" for name in find_packages())],
    package_dir={PACKAGE: "."},
    package_data={
        PACKAGE: [
            "bundles/**",
            "perception/*.onnx",
            "perception/*.safetensors",
            "perception/*.md",
            "perception/NOTICE",
            "words/*.safetensors",
            "detect/*.yaml",
            "detect/labels/*.yaml",
            "robot/robots/*.yaml",
        ]
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
)
