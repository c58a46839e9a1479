# shellcheck shell=bash disable=SC2034  # The sourcing scripts use the variables.
# Shared by the scripts here, which source it: options in COLMAP's manner, and
# where krot is.

if [[ -z ${BASH_VERSION:-} || ${BASH_SOURCE[0]} == "$0" ]]; then
  echo "common.sh is sourced by the scripts next to it" >&2
  exit 1
fi

declare -A option=()  # by name, without the dashes
others=()             # what a script passes on

die() {
  printf '%s: %s\n' "$(basename "$0")" "$*" >&2
  exit 1
}

# The comment at the top of the script, without the line that names the shell.
usage() { sed -n '2,/^[^#]/s/^# \{0,1\}//p' "$0"; }

# parse_options NAMES ARGUMENT... sets option[NAME] from --NAME VALUE and
# --NAME=VALUE; all else is put into `others`. -h prints the usage and exits.
parse_options() {
  local names=" $1 " name
  shift
  while (($#)); do
    case $1 in
      -h | --help) usage; exit 0 ;;
      --*=*) set -- "${1%%=*}" "${1#*=}" "${@:2}" ;;
      --*) ;;
      *) die "'$1' is not an option; -h shows the usage" ;;
    esac
    name=${1#--}
    (($# > 1)) || die "--$name needs a value; -h shows the usage"
    if [[ $names == *" $name "* ]]; then
      option[$name]=$2
    else
      others+=("--$name" "$2")
    fi
    shift 2
  done
}

# require_options NAME... ends the script if one was not given.
require_options() {
  local name
  for name in "$@"; do
    [[ -n ${option[$name]:-} ]] ||
      die "--$name is required; -h shows the usage"
  done
}

# require_programs NAME...
require_programs() {
  local program
  for program in "$@"; do
    command -v "$program" >/dev/null || die "$program is not installed"
  done
}

# require_model NAME ends the script if --NAME is not a COLMAP model's folder.
require_model() {
  local folder=${option[$1]}
  [[ -d $folder ]] || die "--$1 $folder is not a folder"
  [[ -e $folder/images.bin || -e $folder/images.txt ]] ||
    die "--$1 $folder holds no COLMAP model (no images.bin, no images.txt)"
}

# require_text FILE ends the script if it is packed, or UTF-16.
require_text() {
  local is
  case $(head -c 3 "$1" | od -An -tx1 | tr -d ' \n') in
    425a68) is="packed; unpack it with bunzip2" ;;
    1f8b*) is="packed; unpack it with gunzip" ;;
    fd377a) is="packed; unpack it with unxz" ;;
    504b*) is="packed; unpack it with unzip" ;;
    fffe* | feff*) is="UTF-16; save it as UTF-8" ;;
    *) return 0 ;;
  esac
  die "$1 is $is"
}

# find_krot sets krot: the executable named by KROT, or the one that was built
# here, or the installed one.
find_krot() {
  local built
  built=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)/build/krot
  krot=${KROT:-krot}
  [[ -n ${KROT:-} || ! -x $built ]] || krot=$built
  command -v "$krot" >/dev/null ||
    die "$krot is not installed; build it, or name it in KROT"
}

# quietly LOG COMMAND... runs a command with its words in LOG, and ends the
# script if it fails.
quietly() {
  local log=$1 code=0
  shift
  "$@" >"$log" 2>&1 || code=$?
  # 8: krot wrote the model as it was read.
  ((code == 0 || code == 8)) || die "failed, as $log says: $*"
}

export QT_QPA_PLATFORM=${QT_QPA_PLATFORM:-offscreen}  # colmap links Qt.
