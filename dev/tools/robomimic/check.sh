#!/usr/bin/env bash
# Opens a robomimic data set of ./rpbi export with robomimic's get_dataset_info, which fails for actions outside of
# [-1, 1], and compares every cell of its published layout with what was exported.
#
#     dev/tools/robomimic/check.sh DIR
#
# It makes an environment for this in a temporary folder (130 MB, some seconds) and removes it. robomimic's own reader of
# sequences needs torch and is not run. The exit code is 0 if no cell differs.
set -e -o pipefail

dataset=$(readlink -f "${1:?a data set is missing: dev/tools/robomimic/check.sh DIR}")
here=$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")
environment=$(mktemp -d)
trap 'rm -rf "$environment"' EXIT
/usr/bin/python3 -m venv "$environment"
"$environment/bin/pip" install --quiet wheel numpy h5py pyyaml rospkg
"$environment/bin/pip" install --quiet --no-deps robomimic==0.3.0
"$environment/bin/python" -m robomimic.scripts.get_dataset_info --dataset "$dataset/dataset.hdf5"
"$environment/bin/python" "$here/read.py" "$dataset"
