#!/usr/bin/env bash
# Builds krot and its tests into build/ and runs all of them, installing what is
# missing first (with sudo if not root). COLMAP and CLP serve as test oracles,
# Chromium looks at the report page, POV-Ray takes the photos that go through
# COLMAP and back.
# Set KROT_REAL_MODELS to a folder of COLMAP models to test on those as well.
#
# Usage: tools/run_tests.sh
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

install_missing "${build_needs[@]}" libgtest-dev libgmock-dev \
  coinor-libclp-dev coinor-libcoinutils-dev colmap:colmap python3:python3 \
  chromium:chromium chromedriver:chromium-driver povray:povray jq:jq \
  shellcheck:shellcheck
build_krot -DKROT_BUILD_TESTS=ON -DKROT_BUILD_BENCHMARKS=ON

say "Testing"
ctest --test-dir "$root/build" --output-on-failure -j2
