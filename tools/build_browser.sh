#!/usr/bin/env bash
# Builds build-wasm/krot.html, the solver as a page that needs no installation,
# by Debian's emscripten; installs what is missing.
#
# Usage: tools/build_browser.sh
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"
(($# == 0)) || die "usage: tools/build_browser.sh"

install_missing cmake:cmake ninja:ninja-build emcc:emscripten esbuild:esbuild \
  node-jszip libeigen3-dev nlohmann-json3-dev
# For a Node.js that is not Debian's.
export NODE_PATH=/usr/share/nodejs
cd "$root"
cmake --preset wasm
cmake --build --preset wasm
say "Done: $root/build-wasm/krot.html, $(du -k build-wasm/krot.html | cut -f1) kB"
