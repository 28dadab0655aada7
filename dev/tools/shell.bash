# What bash reads when ./rpbi shell opens it.
# shellcheck shell=bash

# shellcheck disable=SC1090 # the user's
[[ -f ~/.bashrc ]] && source ~/.bashrc
# shellcheck source=workspace.bash
source "$(dirname "${BASH_SOURCE[0]}")/workspace.bash"
trap "" INT
source_workspace
trap - INT
unset -f source_workspace
# shellcheck source=completion.bash
source "$(dirname "${BASH_SOURCE[0]}")/completion.bash"
PS1="(rpbi) $PS1"
