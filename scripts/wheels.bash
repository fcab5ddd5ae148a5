# Set-up copies this to .venv/setup.bash: what /opt/ros/jazzy/setup.bash is to a ROS from apt, this is
# to the ROS from wheels. Another ROS in the shell would mix with it, so the paths are not extended but set.
VIRTUAL_ENV=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
export VIRTUAL_ENV AMENT_PREFIX_PATH="$VIRTUAL_ENV" CMAKE_PREFIX_PATH="$VIRTUAL_ENV"
export ROS_DISTRO=jazzy ROS_VERSION=2 ROS_PYTHON_VERSION=3 RMW_IMPLEMENTATION=rmw_fastrtps_cpp
# Set by another environment with such wheels, the guard keeps these from finding their libraries.
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE
