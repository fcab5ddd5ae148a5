# Sourced by bash: the one environment in which cfnav's nodes, tests and tools run.
#   source scripts/env.sh
# ros_ws/install/setup.bash brings ROS and the workspace, as in any colcon workspace. The sources come
# before colcon's copies of them, so that what runs is what was edited.

_cfnav_root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# Once the workspace is through, its stamp is a hash: an interrupted one is not taken for it.
if ! grep -qsE '^[0-9a-f]{64}$' "$_cfnav_root/ros_ws/install/cfnav.stamp" || [ ! -x "$_cfnav_root/.venv/bin/python" ]; then
  echo "cfnav is not set up in $_cfnav_root: run 'make setup' there first." >&2
  return 1
fi

# Another ROS in this shell would mix with ours: its rclpy, its libraries, its ros2. What lies in its
# prefixes, holds an rclpy or is of another Python goes out of every list; ours is sourced below. Only
# where ours is a ROS from apt may workspaces over it stay.
_cfnav_others=
if [ -e "$_cfnav_root/.venv/setup.bash" ] || [ "${ROS_DISTRO:-jazzy}" != jazzy ]; then
  _cfnav_others="${AMENT_PREFIX_PATH:-}:${COLCON_PREFIX_PATH:-}"
fi
_cfnav_own() {
  local entry prefix kept= python=("$_cfnav_root"/.venv/lib/python3.*)
  local -a entries prefixes
  IFS=: read -ra entries <<< "$1"
  IFS=: read -ra prefixes <<< "$_cfnav_others"
  for entry in "${entries[@]}"; do
    if [ -z "$entry" ] || [ -d "$entry/rclpy" ]; then continue; fi
    if [[ "$entry/" == */lib/python3.* && "$entry/" != */lib/"${python[0]##*/}"/* ]]; then continue; fi
    for prefix in "${prefixes[@]}"; do
      case "$prefix" in "" | / | /usr | /usr/local) continue ;; esac
      if [[ "$entry/" == "${prefix%/}"/* ]]; then continue 2; fi
    done
    kept="${kept:+$kept:}$entry"
  done
  printf %s "$kept"
}
for _cfnav_list in PATH PYTHONPATH LD_LIBRARY_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH AMENT_PREFIX_PATH; do
  if [ -n "${!_cfnav_list:-}" ]; then export "$_cfnav_list=$(_cfnav_own "${!_cfnav_list}")"; fi
done

. "$_cfnav_root/ros_ws/install/setup.bash"
export PATH="$_cfnav_root/.venv/bin:$PATH" VIRTUAL_ENV="$_cfnav_root/.venv"
export PYTHONPATH="$_cfnav_root:$_cfnav_root/sim_bridge:$_cfnav_root/cfnav_ros${PYTHONPATH:+:$PYTHONPATH}"
export FASTRTPS_DEFAULT_PROFILES_FILE="$_cfnav_root/cfnav_ros/cfnav_ros/config/fastdds.xml"
# Nothing leaves this machine unless asked for: a robot lab sets SUBNET.
export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"
unset _cfnav_root _cfnav_others _cfnav_list
unset -f _cfnav_own
