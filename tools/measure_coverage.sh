#!/usr/bin/env bash
# Which lines and branches of the library its tests reach: builds into
# build-coverage/, runs the tests there, prints a table for
# docs/history/reliability.md, and lists what no test reached in build-coverage/unreached.txt. Branches that
# only an exception takes are not counted.
#
# Usage: tools/measure_coverage.sh [CTEST_OPTION...]   (-L quick, -R Joint ...)
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

install_missing "${build_needs[@]}" libgtest-dev libgmock-dev libssl-dev coinor-libclp-dev \
  coinor-libcoinutils-dev gcovr:gcovr python3:python3
folder=$root/build-coverage
cmake -S "$root" --preset coverage
cmake --build "$folder" --parallel "$(nproc)"
find "$folder" -name '*.gcda' -delete
say "Testing"
status=0
ctest --test-dir "$folder" --output-on-failure -j"$(nproc)" "$@" || status=$?

say "What the tests reach"
gcovr --root "$root" --object-directory "$folder" --filter "$root/src/krot/" \
  --exclude-throw-branches --exclude-unreachable-branches -j "$(nproc)" \
  --json "$folder/coverage.json" "$folder"
python3 -B "$root/tools/docs/coverage.py" "$folder/coverage.json" \
  "$folder/unreached.txt"
exit "$status"
