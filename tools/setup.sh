# shellcheck shell=bash disable=SC2034  # The sourcing scripts use the variables.
# Shared by the scripts beside it, which source it: what Debian
# packages a build needs, and the build itself.

if [[ -z ${BASH_VERSION:-} || ${BASH_SOURCE[0]} == "$0" ]]; then
  echo "setup.sh is sourced by the scripts beside it" >&2
  exit 1
fi

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# PROGRAM:PACKAGE is satisfied by any such program, PACKAGE only by the package.
build_needs=(cmake:cmake ninja:ninja-build c++:g++ libeigen3-dev
  libboost-program-options-dev libceres-dev libjpeg-dev libpng-dev
  libsqlite3-dev nlohmann-json3-dev)

say() { printf '\n== %s\n' "$*"; }

die() {
  printf '%s: %s\n' "$(basename "$0")" "$*" >&2
  exit 1
}

# is_met NEED
is_met() {
  if [[ $1 == *:* ]] && command -v "${1%%:*}" >/dev/null; then return 0; fi
  [[ $(dpkg-query -W -f='${db:Status-Status}' "${1#*:}" 2>/dev/null) \
    == installed ]]
}

# install_missing NEED... installs the packages that are not there yet; only
# then does it need root, the network or a Debian.
install_missing() {
  local need missing=() as_root=()
  for need in "$@"; do
    is_met "$need" || missing+=("${need#*:}")
  done
  ((${#missing[@]})) || return 0
  if ! command -v apt-get >/dev/null; then
    say "No apt-get here; these Debian packages' counterparts are needed:" \
      "${missing[*]}"
    return 0  # They may be there under other names: CMake will tell.
  fi
  if ((EUID != 0)); then
    command -v sudo >/dev/null || die "these packages are missing, and neither" \
      "root nor sudo is at hand to install them: ${missing[*]}"
    as_root=(sudo)
  fi
  say "Installing ${missing[*]}"
  local apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q)
  "${apt[@]}" update
  "${apt[@]}" install -y --no-install-recommends "${missing[@]}"
}

# build_krot FOLDER CMAKE_OPTION... builds into FOLDER, in the generator of an
# earlier build if there is one: all, or $target.
build_krot() {
  local folder=$1 generator=(-G Ninja)
  shift
  [[ ! -e $folder/CMakeCache.txt ]] || generator=()
  say "Building into $folder"
  cmake -S "$root" -B "$folder" "${generator[@]}" \
    -DCMAKE_BUILD_TYPE=Release "$@"
  cmake --build "$folder" --parallel "$(nproc)" --target "${target:-all}"
}
