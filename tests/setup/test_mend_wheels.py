"""The ROS wheels' CMake files name this machine's folders in place of their builder's."""

from __future__ import annotations

import re

import pytest

EXPORT = (
    'INTERFACE_INCLUDE_DIRECTORIES "/opt/python/cp311-cp311/include/python3.11;'
    '/opt/python/cp311-cp311/lib/python3.11/site-packages/numpy/_core/include"\n'
    'INTERFACE_LINK_LIBRARIES "std_msgs::std_msgs__rosidl_generator_c"\n'
)


@pytest.fixture
def export(tmp_path):
    file = tmp_path / "std_msgs/cmake/export.cmake"
    file.parent.mkdir(parents=True)
    file.write_text(EXPORT)
    return file


def test_the_builders_folders_are_replaced_and_nothing_else(mend_wheels, tmp_path, export):
    cached = tmp_path / "cached"
    cached.hardlink_to(export)
    for _ in range(2):  # mending again changes nothing
        mend_wheels.mend(tmp_path, "/usr/include/python3.11", "/venv/numpy/include")
        assert export.read_text() == (
            'INTERFACE_INCLUDE_DIRECTORIES "/usr/include/python3.11;/venv/numpy/include"\n'
            'INTERFACE_LINK_LIBRARIES "std_msgs::std_msgs__rosidl_generator_c"\n'
        )
    assert list(export.parent.iterdir()) == [export]
    assert cached.read_text() == EXPORT  # as uv's cache has it


def test_an_unknown_folder_of_the_builder_is_said(mend_wheels, steps, tmp_path, export):
    export.write_text('set(LIB "/opt/python/cp311-cp311/lib/libx.so")\n')
    with pytest.raises(steps.SetupError, match=re.escape("(/opt/python/cp311-cp311/lib/libx.so")):
        mend_wheels.mend(tmp_path, "/inc", "/np")


@pytest.mark.ros
def test_the_installed_wheels_are_mended(commands, system):
    if system.find_ros({}, commands.VENV / "cfnav/ros") != commands.VENV:
        return  # the ROS of this machine was built on it
    exports = list((commands.VENV / "share").glob("*/cmake/*rosidl_generator_pyExport.cmake"))
    assert exports
    assert not [p for p in exports if "/opt/python/" in p.read_text()]
