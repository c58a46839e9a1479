#!/usr/bin/env bash
# Prints every benchmark: those of the paper, with every rival, and those of
# speed and size. Meant to take less than 30 minutes on two idle cores.
# Builds krot and krot_benchmark into build/ first (or takes those in BUILD).
#
# Usage: tools/benchmark/run_all.sh [MODELS] [OUTPUT]
#
# MODELS is a folder of COLMAP models, by default KROT_REAL_MODELS; without it
# synthetic models alone are measured. SYNTHETIC_SIZES (of 6, the paper's Table
# 2) and MAX_OBSERVATIONS (of `scaling`) ask for more. OUTPUT is a folder for the tables
# (*.md), reports (*.json) and plots (*.svg); by default they are thrown away.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
models=${1:-${KROT_REAL_MODELS:-}}
output=${2:-$(mktemp -d)}
mkdir -p "$output"

if [[ -z ${BUILD:-} ]]; then
  # shellcheck source=tools/setup.sh
  source "$here/../setup.sh"
  install_missing "${build_needs[@]}"
  build_krot -DKROT_BUILD_BENCHMARKS=ON
  BUILD=$root/build
fi

# --input_path M for every folder in $models that `krot` can solve.
inputs=()
if [[ -n $models ]]; then
  for model in "$models"/*/; do
    if "$BUILD/krot" point_triangulator --input_path "$model" --output_path \
      "$output/probe" --overwrite 1 --log_level 0 >/dev/null 2>&1; then
      inputs+=(--input_path "$model")
    fi
  done
  rm -rf "$output/probe"
fi
# The largest few, which are worth a sweep's timing.
large=()
for name in tower south128_full; do
  if [[ -n $models && -d $models/$name ]]; then
    large+=(--input_path "$models/$name")
  fi
done

# run NAME COMMAND OPTION... : prints, and keeps $output/NAME.*
run() {
  local name=$1
  shift
  printf '\n'
  "$BUILD/krot_benchmark" "$@" --format markdown \
    --report_path "$output/$name.json" --plot_path "$output/$name.svg" |
    tee "$output/$name.md"
}

run triangulation triangulation "${inputs[@]}"
run triangulation_inf triangulation --norm inf "${inputs[@]}"
# All six sizes of the paper's Table 2 take much longer than that with paper settings.
run known_rotation known_rotation --time_limit 20 --repeats 1 \
  --synthetic_sizes "${SYNTHETIC_SIZES:-2}" "${inputs[@]}"
run sweep sweep "${large[@]}"
run scaling scaling --max_observations "${MAX_OBSERVATIONS:-1000000}"
if [[ ${#inputs[@]} -gt 0 ]] && command -v colmap >/dev/null; then
  run joint joint "${inputs[@]}"
fi
