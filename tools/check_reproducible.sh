#!/usr/bin/env bash
# Builds krot twice, at two paths, and compares the executables byte by byte.
#
# Usage: tools/check_reproducible.sh
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
install_missing "${build_needs[@]}"
for copy in first second; do
  mkdir -p "$scratch/$copy/source"
  git -C "$root" archive HEAD | tar -x -C "$scratch/$copy/source"
  # What assertions and logs call a file must not be where it happens to lie.
  map=-ffile-prefix-map=$scratch/$copy=.
  cmake -S "$scratch/$copy/source" -B "$scratch/$copy/build" -G Ninja \
    -DCMAKE_BUILD_TYPE=Release -DKROT_BUILD_TESTS=OFF -DKROT_NATIVE=OFF \
    -DCMAKE_CXX_FLAGS="$map" >/dev/null
  cmake --build "$scratch/$copy/build" --parallel "$(nproc)" --target krot
done
cmp "$scratch/first/build/krot" "$scratch/second/build/krot"
say "Two builds, the same $(stat -c %s "$scratch/first/build/krot") bytes"
