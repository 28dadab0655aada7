#!/usr/bin/env bash
# Opens a LeRobot data set of ./rpbi export with LeRobot's own reader, and runs lerobot-doctor on it.
#
#     dev/tools/lerobot/check.sh DIR
#
# It makes an environment for this in a temporary folder (1.5 GB, a minute) and removes it, or uses and keeps the one in
# the folder LEROBOT_ENV. The exit code is 0 if no cell differs and the doctor finds nothing to fail.
set -e -o pipefail

dataset=$(readlink -f "${1:?a data set is missing: dev/tools/lerobot/check.sh DIR}")
here=$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")
environment=$LEROBOT_ENV
if [[ ! $environment ]]; then
  environment=$(mktemp -d)
  trap 'rm -rf "$environment"' EXIT
fi
if [[ ! -e $environment/ready ]]; then
  /usr/bin/python3 -m venv --clear "$environment"
  # LeRobot 0.4.4 by itself, since it asks for a torch for graphics cards and for packages of robots; this torchvision is
  # the last one with a reader of videos, which needs none of its compiled parts
  "$environment/bin/pip" install --quiet torch==2.13.0 "numpy<2.3" av==15.1.0 "pyarrow<26" "datasets>=4,<5" \
    "huggingface_hub<1" accelerate jsonlines einops draccus==0.10.0 deepdiff pandas pillow rich pyyaml \
    rospkg lerobot-doctor==0.2.0
  "$environment/bin/pip" install --quiet --no-deps lerobot==0.4.4 torchvision==0.24.1
  touch "$environment/ready"
fi
status=0
"$environment/bin/python" -W ignore "$here/read.py" "$dataset" || status=1
"$environment/bin/lerobot-doctor" check "$dataset" || status=1
exit $status
