#!/usr/bin/env bash
# Builds build-packages/*.deb, for any machine of this architecture: krot, the
# command with manual pages and completion, and libkrot-dev, the library.
#
# Usage: tools/make_packages.sh [CMAKE_OPTION...]
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

folder=$root/build-packages

install_missing "${build_needs[@]}" dpkg-shlibdeps:dpkg-dev file:file
build_krot "$folder" -DCMAKE_INSTALL_PREFIX=/usr -DKROT_NATIVE=OFF \
  -DKROT_BUILD_TESTS=OFF "$@"
rm -f "$folder"/*.deb
(cd "$folder" && cpack -G DEB >/dev/null)
ls "$folder"/*.deb
