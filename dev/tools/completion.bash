# Completion of ./rpbi in bash: source this file, for instance in ~/.bashrc.
# shellcheck shell=bash

# Prints the checkout of the command that is being completed.
_rpbi_root() {
  local command=${COMP_WORDS[0]/#\~/$HOME}
  command=$(readlink -f "$(type -P -- "$command")") && dirname "$command"
}

# Prints those of the lines of others, such as names in a launch file, that bash inserts and reads as they are: without
# `$`, backquotes, quotes, spaces and control characters, and no option. At most 2000.
_rpbi_plain() {
  head -c 1000000 | LC_ALL=C grep -axE '[A-Za-z0-9_][A-Za-z0-9_./:=@%+,-]{0,249}' | head -n 2000
}

# Prints the lines that start with a word. `compgen -W` would run what is in `$(...)` of a line.
_rpbi_starting_with() {
  local each
  while IFS= read -r each; do
    [[ $each != "$1"* ]] || printf '%s\n' "$each"
  done
}

# What arguments may be: functions of these names print words. Arguments: the checkout, the words after the command.

_rpbi_examples() { (cd "$1/src/rpbi_examples/launch" && printf '%s\n' *.launch | sed 's/\.launch$//'); }
_rpbi_extras() { (cd "$1/requirements/extras" && printf '%s\n' *.txt | sed 's/\.txt$//'); }
_rpbi_benchmarks() { sed -n "/^BENCHMARKS/,/^)/p; /^WHEN_NAMED/p" "$1/dev/benchmarks/run.py" | grep -oE '"[a-z_]+"' | tr -d '"'; }
_rpbi_pictures() { sed -n "/^PICTURES/,/^}/p" "$1/dev/pictures/draw.py" | grep -oE '^ +"[a-z_]+' | tr -d ' "'; }

# Prints the arguments, as NAME:=, of a launch file, an example's or one that runs a world.
_rpbi_launch_arguments() {
  local file=$2
  [[ -e $file && $file == *.launch ]] || file=$1/src/rpbi_examples/launch/${2%.launch}.launch
  [[ $2 != *.yaml ]] || file=$1/src/rpbi_examples/launch/world.launch
  [[ -f $file ]] || return
  timeout 2 head -c 1000000 -- "$file" 2>/dev/null | # some files of /proc wait for ever
    sed -n 's/^ *<arg name="\([^"]*\)" default=.*/\1:=/p' | _rpbi_plain
}

# Prints what is in the running world; sets nothing up, unlike ./rpbi list. An attachment has the name of what it holds.
_rpbi_objects() (
  # shellcheck disable=SC1091 # catkin writes it
  { source "$1/devel/setup.bash" && ulimit -v 2000000 &&
    timeout -k 1 5 "$1/.venv/bin/python3" "$1/devel/lib/rpbi_utils/world" list; } 2>/dev/null |
    sed 's/ .*//' | _rpbi_plain
)

# Prints what the argument under the cursor may be, as lines of dev/tools/completion.txt without command and place.
# Arguments: the checkout, the words before the cursor.
_rpbi_sources() {
  local root=$1 command=$3 last=${!#} place=$(($# - 2))
  [[ $last == --* ]] || last=none
  awk -v command="$command" -v place="$place" -v option="$last" '
    $1 != command { next }
    { where = $2; sub(/^[^ ]+ [^ ]+ /, "") }
    where == option { of_option = of_option $0 "\n" }
    where == place || where == "*" { of_place = of_place $0 "\n" }
    END { printf "%s", of_option ? of_option : of_place }
  ' "$root/dev/tools/completion.txt"
}

# Prints the words that may stand there, one a line. Arguments: the checkout, the word, the words before it.
_rpbi_words() {
  local root=$1 word=$2 command=${4-} page=$1/docs/commands.md kind words section
  (($# > 3)) && [[ $command != help ]] || { sed -n 's/^## \([a-z_]*\)$/\1/p' "$page" && return; }
  section='/^## '$command'$/,/^## /'
  [[ $word != -* ]] || { { echo --help && sed -n "$section p" "$page" | grep -oE -- '--[a-z-]+'; } | sort -u && return; }
  while read -r kind words; do
    case $kind in
      files) ;;
      words) tr ' ' '\n' <<<"$words" ;;
      *) "_rpbi_$kind" "$root" "${@:5}" ;;
    esac
  done < <(_rpbi_sources "$root" "${@:3}")
}

# Prints the pattern of the files that may stand there, nothing if none may. Arguments: the checkout, the words before it.
_rpbi_files() { _rpbi_sources "$@" | sed -n 's/^files //p' | head -n 1; }

_rpbi() {
  local root words word=$2 file pattern line=${COMP_LINE:0:COMP_POINT}
  root=$(_rpbi_root) || return
  # `:` and `=` divide words for bash, not for us: divide the line by spaces
  read -ra words <<<"$line"
  [[ $line != *' ' ]] || words+=('')
  local whole=${words[-1]}
  unset 'words[-1]'
  local kept=${whole%"$word"} # what stands before the cursor's word already, such as NAME:=
  [[ $whole == *"$word" ]] || kept=
  mapfile -t COMPREPLY < <(_rpbi_words "$root" "$whole" "${words[@]}" | _rpbi_starting_with "$whole")
  COMPREPLY=("${COMPREPLY[@]#"$kept"}")
  [[ ${COMPREPLY[*]} != *:= ]] || compopt -o nospace
  pattern=$(_rpbi_files "$root" "${words[@]}")
  [[ $pattern && $whole != -* ]] || return
  compopt -o filenames
  while IFS= read -r file; do
    # shellcheck disable=SC2053 # it is a pattern
    [[ $file == *[[:cntrl:]]* || (! -d $file && ${file##*/} != $pattern) ]] || COMPREPLY+=("$file")
  done < <(compgen -f -- "$word")
}

shopt -s extglob
complete -F _rpbi rpbi
