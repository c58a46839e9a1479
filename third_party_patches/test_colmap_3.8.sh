#!/usr/bin/env bash
# Builds COLMAP 3.8 from Debian's sources with the patches of colmap-3.8/, GUI
# included, against a KROT installed for it, and compares its commands with
# krot's on the bundled sample: same translations and points, to the bit.
# Installs what is missing. May be run again, and goes on where it was.
#
# Usage: third_party_patches/test_colmap_3.8.sh FOLDER
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/../tools/setup.sh"
(($# == 1)) || die "usage: test_colmap_3.8.sh FOLDER"
mkdir -p "$1"
work=$(cd "$1" && pwd)
export QT_QPA_PLATFORM=offscreen

install_missing "${build_needs[@]}" dpkg-dev colmap:colmap libboost-all-dev \
  libflann-dev libfreeimage-dev libmetis-dev libgoogle-glog-dev libgflags-dev \
  libsqlite3-dev libglew-dev libqt5opengl5-dev qtbase5-dev liblz4-dev

# Debian's source package, by apt with a source list of its own.
get_sources() {
  local keyring=/usr/share/keyrings/debian-archive-keyring.gpg
  mkdir -p "$work/apt/lists/partial" "$work/apt/cache/archives/partial"
  echo "deb-src [signed-by=$keyring] http://deb.debian.org/debian bookworm main" \
    >"$work/apt/sources.list"
  local apt=(apt-get -q -o "Dir::Etc::sourcelist=$work/apt/sources.list"
    -o Dir::Etc::sourceparts=- -o "Dir::State::lists=$work/apt/lists"
    -o "Dir::Cache=$work/apt/cache")
  "${apt[@]}" update
  (cd "$work" && "${apt[@]}" source --download-only colmap=3.8-1)
  dpkg-source -x "$work/colmap_3.8-1.dsc" "$work/unpatched"
  local patch
  for patch in "$here"/colmap-3.8/*.patch; do
    patch -d "$work/unpatched" -p1 <"$patch"
  done
  mv "$work/unpatched" "$work/colmap"
}

# build SOURCE FOLDER CMAKE_OPTION...
build() {
  local source=$1 folder=$2
  shift 2
  cmake -S "$source" -B "$folder" -G Ninja -DCMAKE_BUILD_TYPE=Release "$@"
  cmake --build "$folder" --parallel "$(nproc)"
}

say "KROT into $work/krot"
build "$root" "$work/krot-build" -DKROT_BUILD_TESTS=OFF -DKROT_INSTALL_FOLDERS=ON
cmake --install "$work/krot-build" --prefix "$work/krot"
[[ -d $work/colmap ]] || get_sources
say "COLMAP 3.8 with KROT into $work/colmap-build"
started=$SECONDS
build "$work/colmap" "$work/colmap-build" "-DCMAKE_PREFIX_PATH=$work/krot" \
  -DCUDA_ENABLED=OFF -DCGAL_ENABLED=OFF -DBOOST_STATIC=OFF
say "Built in $((SECONDS - started)) s"
patched=$work/colmap-build/src/exe/colmap

# as_text MODEL FOLDER writes it as text, by COLMAP, records in sorted lines:
# COLMAP writes them in the order of its hash maps.
as_text() {
  mkdir -p "$2"
  colmap model_converter --input_path "$1" --output_path "$2" \
    --output_type TXT >/dev/null
  local file
  for file in cameras images points3D; do
    grep -v '^#' "$2/$file.txt" | sort -o "$2/$file.sorted"
  done
}

# compare COMMAND COLMAP_COMMAND OPTIONS: both on the same model.
compare() {
  local command=$1 colmap_command=$2 file
  shift 2
  rm -rf "${work:?}/$command"
  mkdir -p "$work/$command/colmap"
  say "colmap $colmap_command"
  "$patched" "$colmap_command" --input_path "$work/input" \
    --output_path "$work/$command/colmap" "$@"
  "$work/krot-build/krot" "$command" --input_path "$work/input" \
    --output_path "$work/$command/krot" --log_level 0 "$@" >/dev/null
  as_text "$work/$command/colmap" "$work/$command/colmap_text"
  as_text "$work/$command/krot" "$work/$command/krot_text"
  for file in cameras images points3D; do
    cmp "$work/$command/"{colmap,krot}_text/"$file.sorted" \
      || die "colmap $colmap_command and krot $command differ in $file"
  done
  say "colmap $colmap_command and krot $command: the same poses and points"
}

# COLMAP normalises quaternions when it reads: both begin with what that leaves as
# it is.
rm -rf "${work:?}/input"
cp -r "$root/tools/sample/model" "$work/input"
for ((n = 0; n < 5; ++n)); do
  rm -rf "$work/normalised"
  mkdir "$work/normalised"
  colmap model_converter --input_path "$work/input" \
    --output_path "$work/normalised" --output_type BIN >/dev/null
  rm -r "$work/input"
  mv "$work/normalised" "$work/input"
done
compare solver known_rotation_solver
compare outlier_filter outlier_filter --OutlierFilter.max_error 2.5
