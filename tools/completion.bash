# Completion of ./rpbi in bash: source this file, for instance in ~/.bashrc.
# shellcheck shell=bash

# Prints the checkout of the command that is being completed.
_rpbi_root() {
  local command=${COMP_WORDS[0]/#\~/$HOME}
  command=$(readlink -f "$(type -P -- "$command")") && dirname "$command"
}

# Prints the arguments of a launch file, an example's or one that runs a world, as NAME:=.
_rpbi_arguments() {
  local file=$2
  [[ -e $file && $file == *.launch ]] || file=$1/src/rpbi_examples/launch/${2%.launch}.launch
  [[ $2 != *.yaml ]] || file=$1/src/rpbi_examples/launch/world.launch
  sed -n 's/^ *<arg name="\([^"]*\)" default=.*/\1:=/p' "$file" 2>/dev/null
}

# Prints what is in the running world; sets nothing up, unlike ./rpbi list.
_rpbi_objects() (
  # shellcheck disable=SC1091 # catkin writes it
  { source "$1/devel/setup.bash" && timeout 5 "$1/.venv/bin/python3" "$1/src/rpbi_utils/nodes/world" list; } 2>/dev/null |
    sed 's/ .*//'
)

# Prints what may stand where the cursor is, a word a line. Arguments: the checkout, the word, the words before it.
_rpbi_words() {
  local root=$1 word=$2 command=${4-} first=${5-} last=${!#} page=$1/docs/commands.md
  local section='/^## '$command'$/,/^## /'
  (($# > 3)) || { sed -n 's/^## \([a-z]*\)$/\1/p' "$page" && return; }
  [[ $word != -* ]] || { { echo --help && sed -n "$section p" "$page" | grep -oE -- '--[a-z-]+'; } | sort -u && return; }
  case $command in
    help) sed -n 's/^## \([a-z]*\)$/\1/p' "$page" ;;
    launch)
      [[ $first ]] || { cd "$root/src/rpbi_examples/launch" && printf '%s\n' *.launch | sed 's/\.launch$//'; }
      [[ ! $first ]] || _rpbi_arguments "$root" "$first"
      ;;
    setup) (cd "$root" && printf '%s\n' requirements-*.txt) | sed 's/requirements-\(.*\)\.txt/\1/' ;;
    bench) sed -n "/^BENCHMARKS/,/^)/p; /^WHEN_NAMED/p" "$root/benchmarks/run.py" | grep -oE '"[a-z_]+"' | tr -d '"' ;;
    spawn) [[ $last != --type ]] || printf '%s\n' visual collision dynamic robot urdf soft camera ;;
    remove | detach) _rpbi_objects "$root" ;; # an attachment is called as what it holds
    attach) [[ ${6-} ]] || _rpbi_objects "$root" ;;
    move | send) [[ $first ]] || _rpbi_objects "$root" ;;
  esac
}

# Prints the pattern of the files that may stand there, nothing if none may. Arguments: the words before it.
_rpbi_files() {
  case ${2-} in
    check) echo '*.yaml' ;;
    launch) [[ ${3-} ]] || echo '*.@(launch|yaml)' ;;
    spawn) echo '*.@(yaml|urdf)' ;;
    replay) echo '*.bag' ;;
    test | demo | bench) echo '*' ;;
  esac
}

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
  mapfile -t COMPREPLY < <(compgen -W "$(_rpbi_words "$root" "$whole" "${words[@]}")" -- "$whole")
  COMPREPLY=("${COMPREPLY[@]#"$kept"}")
  [[ ${COMPREPLY[*]} != *:= ]] || compopt -o nospace
  pattern=$(_rpbi_files "${words[@]}")
  [[ $pattern && $whole != -* ]] || return
  compopt -o filenames
  while IFS= read -r file; do
    # shellcheck disable=SC2053 # it is a pattern
    [[ ! -d $file && ${file##*/} != $pattern ]] || COMPREPLY+=("$file")
  done < <(compgen -f -- "$word")
}

shopt -s extglob
complete -F _rpbi rpbi
