"""The ROS wheels' CMake files name this machine's folders in place of their builder's."""

from __future__ import annotations

import re

import pytest

EXPORT = (
    'INTERFACE_INCLUDE_DIRECTORIES "/opt/python/cp311-cp311/include/python3.11;'
    '/opt/python/cp311-cp311/lib/python3.11/site-packages/numpy/_core/include"\n'
    'INTERFACE_LINK_LIBRARIES "std_msgs::std_msgs__rosidl_generator_c"\n'
)


def test_the_builders_folders_are_replaced_and_nothing_else(mend_wheels):
    mended = mend_wheels.mend_text(EXPORT, "/usr/include/python3.11", "/venv/numpy/include")
    assert mended == (
        'INTERFACE_INCLUDE_DIRECTORIES "/usr/include/python3.11;/venv/numpy/include"\n'
        'INTERFACE_LINK_LIBRARIES "std_msgs::std_msgs__rosidl_generator_c"\n'
    )
    assert mend_wheels.mend_text(mended, "/other", "/other") == mended


def test_mending_twice_changes_files_once(mend_wheels, tmp_path):
    cmake = tmp_path / "std_msgs/cmake"
    cmake.mkdir(parents=True)
    (cmake / "export.cmake").write_text(EXPORT)
    (cmake / "other.cmake").write_text("set(x 1)\n")
    assert mend_wheels.mend_files(tmp_path, "/inc", "/np") == 1
    assert mend_wheels.mend_files(tmp_path, "/inc", "/np") == 0
    assert sorted(p.name for p in cmake.iterdir()) == ["export.cmake", "other.cmake"]


def test_an_unknown_folder_of_the_builder_is_said(mend_wheels, tmp_path):
    cmake = tmp_path / "rcl/cmake"
    cmake.mkdir(parents=True)
    (cmake / "export.cmake").write_text('set(LIB "/opt/python/cp311-cp311/lib/libx.so")\n')
    with pytest.raises(ValueError, match=re.escape("(/opt/python/cp311-cp311/lib/libx.so")):
        mend_wheels.mend_files(tmp_path, "/inc", "/np")


@pytest.mark.ros
def test_the_installed_wheels_are_mended(environment):
    if environment.find_ros({}) != environment.WHEELS:
        return  # the ROS of this machine was built on it
    exports = list((environment.VENV / "share").glob("*/cmake/*rosidl_generator_pyExport.cmake"))
    assert exports
    assert not [p for p in exports if "/opt/python/" in p.read_text()]
