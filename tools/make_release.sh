#!/usr/bin/env bash
# Makes what people download, in build-release: krot as one file for Linux and
# for Windows, the Debian packages, the wheel of pykrot and krot.html, with
# SHA256SUMS. Each is tried where nothing of the build is at hand. Needs root,
# for the bare places. It says in the end how long each of them took.
#
# Usage: tools/make_release.sh [linux|windows|deb|wheel|html]...
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"
((EUID == 0)) || die "bare places to try it in are made as root"
parts=("$@")
(($#)) || parts=(linux windows deb wheel html)
release=$root/build-release
version=$(sed -n 's/^project(krot VERSION \([0-9.]*\).*/\1/p' "$root/CMakeLists.txt")
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# In a folder that holds nothing else, not even a shell.
make_linux() {
  "$root/tools/build_static.sh" linux
  cp "$root/build-linux/krot" "$release/krot-$version-linux-x86_64"
  mkdir "$scratch/bare"
  cp -r "$root/build-linux/krot" "$root"/tools/sample/{model,database.db} \
    "$scratch/bare"
  chroot "$scratch/bare" /krot solver --input_path model --output_path solved
  chroot "$scratch/bare" /krot bundle_adjuster --input_path solved \
    --output_path adjusted
  chroot "$scratch/bare" /krot model_checker --input_path adjusted \
    --database_path database.db
}

make_windows() {
  [[ -x $root/build-linux/krot ]] || "$root/tools/build_static.sh" linux
  "$root/tools/build_static.sh" windows
  cp "$root/build-windows/krot.exe" "$release/krot-$version-windows-x86_64.exe"
  "$root/tools/test_windows.sh"
}

# In a bare Debian 12, which builds pykrot from its sources, too.
make_deb() {
  "$root/tools/test_packages.sh" "$scratch/debian"
  cp "$root"/build-packages/*.deb "$release"
}

make_wheel() {
  install_missing "${build_needs[@]}" pip3:python3-pip python3-venv \
    pybind11-dev python3-dev python3-numpy python3-setuptools python3-wheel
  CMAKE_ARGS=-DKROT_NATIVE=OFF pip3 wheel --quiet --no-build-isolation \
    --no-deps --wheel-dir "$release" "$root/src/python"
  python3 -m venv --system-site-packages "$scratch/python"
  "$scratch/python/bin/pip" install --quiet --no-deps "$release"/pykrot-*.whl
  (cd "$scratch" && python/bin/python "$root/tools/examples/solve_folder.py" \
    "$root/tools/sample/model" by_wheel)
}

# In Node.js, beside the krot for Linux.
make_html() {
  [[ -x $root/build-linux/krot ]] || "$root/tools/build_static.sh" linux
  "$root/tools/build_browser.sh"
  cp "$root/build-wasm/krot.html" "$release"
  node --experimental-default-type=module \
    "$root/tests/browser/same_numbers_test.mjs" "$root/build-wasm" \
    "$root/build-linux/krot" "$root/tools/sample/model"
}

mkdir -p "$release"
minutes=()
for part in "${parts[@]}"; do
  [[ $(type -t "make_$part") == function ]] \
    || die "$part is none of linux, windows, deb, wheel, html"
  say "The release: $part"
  begun=$SECONDS
  "make_$part"
  minutes+=("$part $(((SECONDS - begun + 30) / 60)) min")
done
(cd "$release" && rm -f SHA256SUMS && sha256sum -- * >"$scratch/sums" \
  && mv "$scratch/sums" SHA256SUMS)
say "Done: ${minutes[*]}"
(cd "$release" && du -k -- *)
