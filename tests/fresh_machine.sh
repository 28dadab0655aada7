#!/usr/bin/env bash
# Sets up bare Debian machines by the steps of docker/Dockerfile, cuts their network, and runs the workspace there.
#
# A machine is a folder that debootstrap makes. Commands run there in namespaces of their own: mounts and processes
# end with the command, however it ends, so removing the folder can never reach anything else.
set -euo pipefail

repository=$(cd "$(dirname "$(readlink -f "$0")")/.." && pwd -P)
dockerfile=$repository/docker/Dockerfile
longest_s=360
most_mb=3000

usage() {
  cat <<'EOF'
Usage: tests/fresh_machine.sh [OPTIONS]     (as root; needs debootstrap, git, iproute2)

  --root            on a machine where all is done as root
  --user            on a machine with an ordinary user who has sudo; by default both, one after the other
  --deb FILE        only: on a machine without a checkout, installs this package of ./rpbi deb and starts an example
  --no-install      without the install space
  --tests [PATH]    also all extras and the tests, or those of PATH; may be given several times
  --folder FOLDER   where the machines are made, 3 GB (with tests 5 GB) each; by default in /var/tmp
  --mirror URL      Debian mirror; by default the one that this machine's apt uses
  --keep            leaves the machines there
  --steps           only prints the steps that docker/Dockerfile has
EOF
}

fail() {
  printf 'fresh_machine: %s\n' "$*" >&2
  exit 1
}

# --- The steps of the Dockerfile

# Sets suite, directory, steps and start.
read_dockerfile() {
  local instruction arguments
  steps=()
  while read -r instruction arguments; do
    case $instruction in
      '' | '#'*) ;;
      FROM) suite=${arguments#debian:} ;;
      WORKDIR) directory=$arguments ;;
      COPY) [[ $arguments == '. .' ]] || fail "docker/Dockerfile: expected 'COPY . .', got 'COPY $arguments'" ;;
      RUN) steps+=("$arguments") ;;
      CMD) start=$(tr -d '[],"' <<<"$arguments") ;;
      *) fail "docker/Dockerfile: $instruction is not known here" ;;
    esac
  done <"$dockerfile"
}

# --- A machine

# in_namespaces COMMAND...: runs it where its mounts and processes are its own; without network if `offline` is set.
in_namespaces() {
  unshare --mount --pid --fork --kill-child ${offline:+--net} "$@" </dev/null &
  child=$! # waited for, so that a signal is heard at once
  wait "$child"
}

# in_machine ACCOUNT COMMAND: runs it in a login shell.
in_machine() {
  # shellcheck disable=SC2016 # for the inner shell to expand
  in_namespaces bash -euc '
    [[ ! $4 ]] || ip link set lo up
    mount --rbind /dev "$1/dev"
    mount -t proc proc "$1/proc"
    mount -t sysfs -o ro sysfs "$1/sys"
    exec env -i PATH="$PATH" chroot "$1" su --login "$2" --command "$3"
  ' - "$machine" "$1" "$2" "${offline-}"
}

make_base() {
  mirror=${mirror:-$(packages_of_this_machine | sed -n "s| $suite main\$||p" | head -n 1)}
  [[ $mirror ]] || fail "this machine's apt does not know $suite: name a mirror by --mirror"
  mkdir "$folder/base"
  in_namespaces debootstrap --variant=minbase "$suite" "$folder/base" "$mirror" >"$folder/debootstrap.log" 2>&1 ||
    fail "debootstrap failed: $(tail -n 3 "$folder/debootstrap.log")"
  take_over_network "$folder/base"
}

packages_of_this_machine() {
  # shellcheck disable=SC2016 # these are apt's names
  apt-get indextargets --format '$(REPO_URI) $(RELEASE) $(COMPONENT)' 'Identifier: Packages' | sort -u
}

# take_over_network ROOT: a machine reaches Debian's and Python's packages as this one does.
take_over_network() {
  local name key value
  cp --dereference /etc/resolv.conf /etc/hosts "$1/etc/"
  for name in http_proxy https_proxy no_proxy HTTP_PROXY HTTPS_PROXY NO_PROXY; do
    [[ ! -v $name ]] || echo "$name=${!name}" >>"$1/etc/environment"
  done
  apt-config dump | grep -E '^Acquire::(https?::|Check-)' >"$1/etc/apt/apt.conf.d/90this-machine" || true
  packages_of_this_machine | sed -nE "s|(.* $suite(-[a-z]+)? main)\$|deb \1|p" >"$folder/sources.list"
  [[ ! -s $folder/sources.list ]] || mv "$folder/sources.list" "$1/etc/apt/sources.list"
  # Of files and environment variables, the latter count
  declare -A settings=()
  while IFS='=' read -r key value; do settings[${key##*.}]=$(sed "s/^'//; s/'\$//" <<<"$value"); done < <(
    python3 -m pip config list 2>/dev/null | grep -E '^(global|:env:)\.' | sort -r
  )
  echo "[global]" >"$1/etc/pip.conf"
  for key in index-url proxy trusted-host timeout default-timeout; do
    [[ ! -v settings[$key] ]] || echo "$key = ${settings[$key]}" >>"$1/etc/pip.conf"
  done
  if [[ -v settings[cert] ]]; then
    cp --dereference "${settings[cert]}" "$1/etc/pip-certificates.crt"
    echo "cert = /etc/pip-certificates.crt" >>"$1/etc/pip.conf"
  fi
}

# copy_checkout FOLDER: what git knows or would add.
copy_checkout() {
  mkdir -p "$1"
  git -C "$repository" ls-files -z --cached --others --exclude-standard |
    tar --create --directory "$repository" --null --files-from - | tar --extract --no-same-owner --directory "$1"
}

# --- What is done there

# timed TITLE COMMAND...: runs it and notes how long it took [s].
timed() {
  local title=$1 start_s=$SECONDS
  shift
  printf '\n--- %s: %s\n' "$kind" "$title"
  "$@" || fail "$kind: '$title' failed"
  took_s=$((SECONDS - start_s))
  report+=("$(printf '%-6s %-52s %6d s' "$kind" "$title" "$took_s")")
}

# at_checkout COMMAND: runs it as the account, in the checkout.
at_checkout() { in_machine "$account" "cd '$checkout' && $1"; }

use_machine() {
  local total_s=0 step offline=
  kind=$1
  machine=$folder/$kind
  cp --archive "$folder/base" "$machine"
  account=root checkout=$directory
  if [[ $kind == user ]]; then
    account=somebody checkout=/home/somebody/rpbi
    in_machine root "apt-get update && apt-get install --yes --no-install-recommends sudo && apt-get clean &&
      useradd --create-home --shell /bin/bash somebody &&
      echo 'somebody ALL=(ALL) NOPASSWD: ALL' >/etc/sudoers.d/somebody" >"$folder/user.log" 2>&1 ||
      fail "no user could be made: $(tail -n 3 "$folder/user.log")"
  fi
  copy_checkout "$machine$checkout"
  in_machine root "chown -R $account: '$checkout'"
  local bare_mb
  bare_mb=$(used_mb)

  for step in "${steps[@]}"; do
    timed "$step" at_checkout "$step"
    total_s=$((total_s + took_s))
  done
  offline=yes
  timed "$start, without network" at_checkout "! grep -v -e '|' -e lo: /proc/net/dev && $start"
  total_s=$((total_s + took_s))
  report+=("$kind: bare Debian to the finished demo in $total_s s (at most $longest_s: $(holds "$total_s" $longest_s))")
  report+=("$kind: $(used_mb) MB of disk, $bare_mb of them before (at most $most_mb: $(holds "$(used_mb)" $most_mb))")

  if [[ $with_install ]]; then
    timed "catkin_make install, without network" \
      at_checkout 'catkin_make install -DPYTHON_EXECUTABLE=/usr/bin/python3 >install.log 2>&1 || ! tail install.log'
    timed "demo from the install space, devel/ away" at_checkout 'mv devel devel.away &&
      (source install/setup.bash && rosrun rpbi_examples demo.py --headless --out out/install) && mv devel.away devel'
  fi
  if [[ $with_tests ]]; then
    offline=
    timed "./rpbi setup ik mpc tags data gym html assets notebook farm site wheel" at_checkout "./rpbi setup ik mpc tags data gym html assets notebook farm site wheel"
    offline=yes
    timed "./rpbi test ${tests[*]}, without network" at_checkout "./rpbi test ${tests[*]}"
    report+=("$kind: $(used_mb) MB of disk with all extras")
  fi
  [[ $keep ]] || remove "$machine"
}

# use_package FILE: installs it where no checkout is, and starts an example without a network.
use_package() {
  local offline=
  kind=deb
  machine=$folder/deb
  cp --archive "$folder/base" "$machine"
  cp "$1" "$machine/root/rpbi.deb"
  timed "apt-get install rpbi.deb" in_machine root \
    'apt-get update && apt-get install --yes --no-install-recommends ./rpbi.deb >install.log 2>&1 || ! tail install.log'
  offline=yes
  timed "the example, until its camera's first image" in_machine root 'source /opt/rpbi/install/setup.bash
    roslaunch rpbi_examples basic_example_kuka_lwr.launch headless:=true & until rostopic list >/dev/null 2>&1; do sleep 1; done
    timeout 60 rostopic echo -n 1 --noarr /rpbi/camera/colour/image && kill -INT $! && wait $!'
  report+=("$kind: $(used_mb) MB of disk")
  [[ $keep ]] || remove "$machine"
}

used_mb() { du --summarize --one-file-system --block-size=1000000 "$machine" | cut -f 1; }
holds() { (($1 <= $2)) && echo yes || echo NO; }

# --- Cleaning up

# remove FOLDER: but nothing that is mounted there.
remove() {
  ! grep --quiet --fixed-strings " $1" /proc/self/mounts || fail "$1 has mounts; it is left there"
  rm --recursive --force --one-file-system "$1"
}

clean_up() {
  local status=$?
  trap - EXIT INT TERM HUP
  # All processes of its namespace end with it; of other signals, unshare would wait for them
  [[ ! $child ]] || { kill -KILL "$child" && wait; } 2>/dev/null || true
  printf '%s\n' '' "${report[@]}"
  if [[ $keep ]]; then echo "The machines are left in $folder."; else remove "$folder"; fi
  exit "$status"
}

kinds=() tests=() package='' with_install=yes with_tests='' keep='' folder='' mirror='' child='' offline='' report=()
while (($#)); do
  case $1 in
    --root | --user) kinds+=("${1#--}") ;;
    --deb) package=${2:?--deb: expected a package} && shift ;;
    --no-install) with_install= ;;
    --tests)
      with_tests=yes
      [[ ! ${2-} || $2 == --* ]] || { tests+=("$2") && shift; }
      ;;
    --folder) folder=${2:?--folder: expected a folder} && shift ;;
    --mirror) mirror=${2:?--mirror: expected a URL} && shift ;;
    --keep) keep=yes ;;
    --steps) only_steps=yes ;;
    -h | --help) usage && exit ;;
    *) usage >&2 && exit 2 ;;
  esac
  shift
done
((${#kinds[@]})) || kinds=(root user)

read_dockerfile
if [[ ${only_steps-} ]]; then
  printf '%s\n' "debian $suite" "in $directory" "${steps[@]}" "$start"
  exit
fi
((EUID == 0)) || fail "only root may make machines"
for tool in debootstrap git ip unshare; do
  command -v "$tool" >/dev/null || fail "$tool is missing here"
done
folder=$(mktemp --directory --tmpdir="${folder:-/var/tmp}" rpbi-machines-XXXXXX)
trap clean_up EXIT
trap 'exit 130' INT
trap 'exit 143' TERM HUP
make_base
[[ ! $package ]] || { use_package "$package" && exit; }
for kind in "${kinds[@]}"; do use_machine "$kind"; done
