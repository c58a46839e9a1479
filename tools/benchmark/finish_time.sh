#!/usr/bin/env bash
# What the default `krot solver` costs, finish included, beside COLMAP's bundle
# adjuster on the same model, both from start to exit on two threads.
#
#   finish_time.sh KROT MODELS NAME...
#
# Prints wall-clock seconds of both (of KROT the median of KROT_BENCHMARK_RUNS
# runs, of COLMAP one), their ratio, iterations of the finish, and its seconds
# beside those of all before it; at last the medians of both ratios.
set -euo pipefail

krot=$(realpath "$1")
models=$(realpath "$2")
shift 2
runs=${KROT_BENCHMARK_RUNS:-3}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export QT_QPA_PLATFORM=offscreen

median() { sort -g | awk '{ v[NR] = $1 } END { print v[int((NR + 1) / 2)] }'; }

# seconds COMMAND... prints the wall-clock time of a command.
seconds() {
  local started=$EPOCHREALTIME
  "$@" >"$work/log" 2>&1
  echo "$EPOCHREALTIME $started" | awk '{ print $1 - $2 }'
}

# run_times NAME writes whole, finish and the seconds before it, run by run.
run_times() {
  local run
  : >"$work/whole"
  : >"$work/finish"
  : >"$work/before"
  for ((run = 0; run < runs; ++run)); do
    seconds "$krot" solver --input_path "$models/$1" --output_path "$work/krot" \
      --overwrite 1 --report_path "$work/report.json" --log_level 0 \
      --Solver.num_threads 2 >>"$work/whole"
    jq .finish.seconds "$work/report.json" >>"$work/finish"
    jq '.seconds.solve - .finish.seconds' "$work/report.json" >>"$work/before"
  done
}

echo "| model | krot s | colmap s | ratio | iterations | finish s | before it s |"
echo "|---|---|---|---|---|---|---|"
for name in "$@"; do
  run_times "$name"
  rm -rf "$work/colmap"
  mkdir "$work/colmap"
  colmap=$(seconds taskset -c 0,1 colmap bundle_adjuster \
    --input_path "$models/$name" --output_path "$work/colmap")
  whole=$(median <"$work/whole")
  finish=$(median <"$work/finish")
  before=$(median <"$work/before")
  echo "$whole $colmap $finish $before" \
    | awk '{ print $1 / $2, $3 / $4 }' >>"$work/ratios"
  awk -v name="$name" -v whole="$whole" -v colmap="$colmap" \
    -v iterations="$(jq .finish.num_iterations "$work/report.json")" \
    -v finish="$finish" -v before="$before" 'BEGIN {
      printf "| %s | %.2f | %.2f | %.3f | %d | %.2f | %.2f |\n", name, whole,
             colmap, whole / colmap, iterations, finish, before }'
done
echo
echo "Medians: krot / colmap $(cut -d' ' -f1 "$work/ratios" | median)," \
  "finish / all before it $(cut -d' ' -f2 "$work/ratios" | median)"
