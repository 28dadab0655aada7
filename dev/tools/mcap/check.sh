#!/usr/bin/env bash
# Reads the rosbag2 recordings of ./rpbi export --to mcap with the packages of MCAP, and compares every message with the
# bag that it came from. CRCs are checked where the file has them.
#
#     dev/tools/mcap/check.sh DIR
#
# It makes an environment for this in a temporary folder (60 MB, some seconds) and removes it; the bags are read by
# Debian's rosbag. The exit code is 0 if no message differs.
set -e -o pipefail

dataset=$(readlink -f "${1:?a data set is missing: dev/tools/mcap/check.sh DIR}")
here=$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")
environment=$(mktemp -d)
trap 'rm -rf "$environment"' EXIT
/usr/bin/python3 -m venv --system-site-packages "$environment"
"$environment/bin/pip" install --quiet mcap==1.6.0 mcap-ros2-support==0.6.0
"$environment/bin/python" -W ignore "$here/read.py" "$dataset"
