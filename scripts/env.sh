# Sourced by bash: the environment in which cfnav's nodes, tests and tools run.
#   . scripts/env.sh
# Sets PATH, PYTHONPATH, AMENT_PREFIX_PATH, LD_LIBRARY_PATH and the transport profile. The sources come
# before colcon's copies of them, so that what runs is what was edited.

_cfnav_root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

if [ ! -f "$_cfnav_root/.venv/cfnav/workspace.stamp" ] || [ ! -f "$_cfnav_root/ros_ws/install/local_setup.bash" ]; then
  echo "cfnav is not set up in $_cfnav_root: run 'make setup' there first." >&2
  return 1
fi

# The guard stops the wheels from finding their libraries when another virtual environment has set it.
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE
export PATH="$_cfnav_root/.venv/bin:$PATH" VIRTUAL_ENV="$_cfnav_root/.venv"

_cfnav_ros=$(cat "$_cfnav_root/.venv/cfnav/ros")
if [ "$_cfnav_ros" = wheels ]; then
  export AMENT_PREFIX_PATH="$_cfnav_root/.venv" ROS_DISTRO=jazzy ROS_VERSION=2 ROS_PYTHON_VERSION=3
  export RMW_IMPLEMENTATION=rmw_fastrtps_cpp
elif [ -z "${AMENT_PREFIX_PATH:-}" ]; then
  . "$_cfnav_ros/setup.bash"
fi
. "$_cfnav_root/ros_ws/install/local_setup.bash"

export PYTHONPATH="$_cfnav_root:$_cfnav_root/sim_bridge:$_cfnav_root/cfnav_ros${PYTHONPATH:+:$PYTHONPATH}"
export FASTRTPS_DEFAULT_PROFILES_FILE="$_cfnav_root/cfnav_ros/cfnav_ros/config/fastdds.xml"
# Nothing leaves this machine unless asked for: a robot lab sets SUBNET.
export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"
unset _cfnav_root _cfnav_ros
