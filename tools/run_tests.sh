#!/usr/bin/env bash
# Builds krot and its tests into build/ and runs all of them, installing what is
# missing first (with sudo if not root). COLMAP and CLP serve as test oracles,
# Chromium looks at the report page, POV-Ray takes the photos that go through
# COLMAP and back; pykrot is for Debian's own Python. krot.html is built and
# tested, in Firefox too, where emscripten is installed.
# Set KROT_REAL_MODELS to a folder of COLMAP models to test on those as well.
# Tests that are skipped are listed in the end, each with its reason; with
# KROT_NO_SKIPS=1 there must be none.
#
# Usage: tools/run_tests.sh
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

# Of ctest's log: "name: reason" for every test that was skipped.
list_skipped() {
  awk '/^[0-9]+\/[0-9]+ Test(ing)?: / { name = $3 }
       /: Skipped$/ { getline reason; print name ": " reason }
       /^skipped: / { print name ": " substr($0, 10) }' "$1" | sort -u
}

install_missing "${build_needs[@]}" libgtest-dev libgmock-dev libssl-dev \
  coinor-libclp-dev coinor-libcoinutils-dev colmap:colmap python3:python3 \
  chromium:chromium chromedriver:chromium-driver povray:povray jq:jq \
  CartConvert:geographiclib-tools \
  pkg-config:pkgconf shellcheck:shellcheck pybind11-dev python3-dev python3-numpy python3-pytest
browser_page=
browser_log=$root/build/browser.log
if command -v emcc >/dev/null && command -v esbuild >/dev/null; then
  install_missing firefox-esr:firefox-esr
  say "Building krot.html at the same time, with its words in $browser_log"
  mkdir -p "$root/build"
  trap 'kill %1 2>/dev/null || true' EXIT
  "$root/tools/build_browser.sh" >"$browser_log" 2>&1 &
  browser_page=$root/build-wasm/krot.html
else
  say "No emscripten here: krot.html is neither built nor tested"
fi
build_krot "$root/build" -DKROT_BUILD_TESTS=ON -DKROT_BUILD_BENCHMARKS=OFF \
  -DKROT_BUILD_PYTHON=ON -DPYTHON_EXECUTABLE=/usr/bin/python3 \
  -DKROT_BROWSER_PAGE="$browser_page"
if [[ -n $browser_page ]]; then
  say "Waiting for krot.html"
  wait %1 || { cat "$browser_log" >&2; die "krot.html could not be built"; }
fi

say "Testing"
closing=$root/build/ctest.out
status=0
ctest --test-dir "$root/build" --output-on-failure -j2 | tee "$closing" \
  || status=$?

skipped=$(list_skipped "$root/build/Testing/Temporary/LastTest.log")
if [[ -n $skipped ]]; then
  say "Skipped: $(wc -l <<<"$skipped")"
  echo "$skipped"
  if [[ ${KROT_NO_SKIPS:-0} == 1 ]]; then status=1; fi
else
  say "Skipped: none"
fi
grep 'tests passed' "$closing"
exit "$status"
