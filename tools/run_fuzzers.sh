#!/usr/bin/env bash
# Builds the libFuzzer targets of tests/fuzz into build-fuzz/, with address and
# undefined behaviour sanitizers, and runs each for SECONDS of every core. What
# was found lies in build-fuzz/findings, one file each: run the target on it.
# Corpora stay in build-fuzz/corpus and are built upon. Prints a table for
# docs/history/reliability.md. Needs Clang, which it installs (with sudo if not root).
#
# Usage: tools/run_fuzzers.sh SECONDS [TARGET...]
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

(($#)) || die "how many seconds? tools/run_fuzzers.sh SECONDS [TARGET...]"
seconds=$1
shift
targets=("$@")
((${#targets[@]})) \
  || targets=(binary text model certificate lists options solve database)

folder=$root/build-fuzz
install_missing "${build_needs[@]}" clang:clang libclang-rt-dev python3:python3
build_krot "$folder" -DCMAKE_CXX_COMPILER=clang++ -DKROT_BUILD_FUZZERS=ON \
  -DKROT_BUILD_TESTS=OFF -DKROT_NATIVE=OFF -DKROT_WARNINGS_AS_ERRORS=OFF \
  -DCMAKE_CXX_FLAGS_RELEASE=-O1 \
  -DCMAKE_CXX_FLAGS="-g1 -fno-omit-frame-pointer -fno-sanitize-recover=all \
  -fsanitize=fuzzer-no-link,address,undefined"
seeds=$folder/seeds
rm -rf "$seeds"
python3 -B "$root/tests/fuzz/make_seeds.py" "$folder/krot" "$seeds"
mkdir -p "$folder/findings" "$folder/logs"

# fuzz TARGET
fuzz() {
  local corpus=$folder/corpus/$1
  mkdir -p "$corpus"
  local TIMEFORMAT=%U
  { time UBSAN_OPTIONS=print_stacktrace=1 "$folder/fuzz/$1_fuzz" \
      -max_total_time="$seconds" -timeout=120 -report_slow_units=120 \
      -rss_limit_mb=2048 -max_len=20000 -print_final_stats=1 \
      -artifact_prefix="$folder/findings/$1-" \
      "$corpus" "$seeds/$1" >"$folder/logs/$1" 2>&1 || true
  } 2>"$folder/logs/$1.seconds"
}

say "Fuzzing ${targets[*]}"
running=0
for target in "${targets[@]}"; do
  if ((running >= $(nproc))); then
    wait -n
    running=$((running - 1))
  fi
  fuzz "$target" &
  running=$((running + 1))
done
wait

found=0
printf '| target | inputs kept | edges reached | executions | processor minutes | findings |\n'
printf '|---|---|---|---|---|---|\n'
for target in "${targets[@]}"; do
  log=$folder/logs/$target
  inputs=$(find "$folder/corpus/$target" -type f | wc -l)
  edges=$(grep -o ' cov: [0-9]*' "$log" | tail -1 | tr -dc 0-9)
  executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
  findings=$(find "$folder/findings" -name "$target-*" | wc -l)
  printf "| \`%s\` | %s | %s | %s | %s | %s |\n" "$target" "$inputs" \
    "${edges:-?}" "${executions:-?}" \
    "$(awk '{ printf "%.0f", $1 / 60 }' "$folder/logs/$target.seconds")" \
    "$findings"
  found=$((found + findings))
done
((found == 0)) || die "$found findings in $folder/findings"
