#!/usr/bin/env bash
# Builds krot alone with the address and undefined behaviour sanitizers, and
# with the thread sanitizer (build-asan/, build-tsan/, as run_sanitizers.sh), and
# runs its commands on every model of the folder DATA, or on those that are
# named, with four threads. Says what a sanitizer said; a refusal is none.
#
# Usage: tools/run_sanitized_commands.sh DATA [NAME...]
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

(($#)) || die "on which models? tools/run_sanitized_commands.sh DATA [NAME...]"
data=$1
shift
names=("$@")
((${#names[@]})) || mapfile -t names < <(cd "$data" && printf '%s\n' */ | tr -d /)

install_missing "${build_needs[@]}"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
found=0

# run SANITIZER KROT NAME COMMAND OPTION...
run() {
  local log=$work/log status=0
  ASAN_OPTIONS=allocator_may_return_null=1:exitcode=99 \
    UBSAN_OPTIONS=print_stacktrace=1 TSAN_OPTIONS=exitcode=99 \
    "$2" "$4" --input_path "$data/$3" "${@:5}" --log_level 0 \
    >"$log" 2>&1 || status=$?
  runs=$((runs + 1))
  if ((status == 99 || status > 128)) \
    || grep -qE 'runtime error|WARNING: ThreadSanitizer' "$log"; then
    printf '%s, %s on %s:\n' "$1" "$4" "$3"
    grep -vE '^ *#' "$log" | head -20
    found=$((found + 1))
  fi
}

for preset in asan tsan; do
  say "Building krot with $preset"
  cmake -S "$root" --preset "$preset" >/dev/null
  cmake --build "$root/build-$preset" --parallel "$(nproc)" --target krot
  krot=$root/build-$preset/krot
  runs=0
  say "Running commands on ${#names[@]} models"
  for name in "${names[@]}"; do
    output=(--output_path "$work/output" --overwrite 1)
    threads=(--Solver.num_threads 4)
    run "$preset" "$krot" "$name" solver "${output[@]}" "${threads[@]}" \
      --certificate_path "$work/proof.json" --html_path "$work/page.html"
    run "$preset" "$krot" "$name" certificate_checker \
      --certificate_path "$work/proof.json"
    run "$preset" "$krot" "$name" point_triangulator "${output[@]}" \
      "${threads[@]}"
    run "$preset" "$krot" "$name" model_analyzer
    run "$preset" "$krot" "$name" outlier_filter "${output[@]}" \
      "${threads[@]}" --OutlierFilter.max_error 4 \
      --conflicts_path "$work/conflicts.json"
    run "$preset" "$krot" "$name" bundle_adjuster "${output[@]}" \
      --BundleAdjustment.max_num_iterations 5
  done
  printf '%s: %d runs, %d findings so far\n' "$preset" "$runs" "$found"
done
((found == 0)) || die "$found findings"
