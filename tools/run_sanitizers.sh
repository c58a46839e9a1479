#!/usr/bin/env bash
# Builds KROT and its tests with the address and undefined behaviour sanitizers
# into build-asan/, with the thread sanitizer into build-tsan/, and runs the
# tests under each. Set KROT_REAL_MODELS to a folder of COLMAP models to test
# on those as well. Needs what tools/run_tests.sh needs.
#
# Usage: tools/run_sanitizers.sh [CTEST_OPTION...]   (-L quick, -R Joint ...)
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

install_missing "${build_needs[@]}" libgtest-dev libgmock-dev libssl-dev coinor-libclp-dev \
  coinor-libcoinutils-dev
status=0
for preset in asan tsan; do
  say "Building with $preset"
  cmake -S "$root" --preset "$preset"
  cmake --build "$root/build-$preset" --parallel "$(nproc)"
  say "Testing with $preset"
  # The end of a test is not the end of its threads: the pool is never
  # destroyed. Allocations that cannot be served are tested for, and so are
  # threads of a child that was forked.
  ASAN_OPTIONS=allocator_may_return_null=1 \
    UBSAN_OPTIONS=print_stacktrace=1 \
    TSAN_OPTIONS="second_deadlock_stack=1 die_after_fork=0" \
    ctest --test-dir "$root/build-$preset" --output-on-failure -j"$(nproc)" \
    "$@" || status=$?
done
exit "$status"
