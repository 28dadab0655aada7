# The environment of the workspace, for ./rpbi and for the shell that it opens.
# shellcheck shell=bash

source_workspace() {
  local root
  root=$(readlink -f "$(dirname "${BASH_SOURCE[0]}")/../..")
  unset PYTHONHOME PYTHONPATH CMAKE_PREFIX_PATH ROS_PACKAGE_PATH
  export LC_ALL=C.UTF-8
  # shellcheck disable=SC1091 # catkin writes it
  source "$root/devel/setup.bash"
  export PATH=$root/.venv/bin:$PATH
}
