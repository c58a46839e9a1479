#!/usr/bin/env bash
# Prints every benchmark: those of the paper, with every rival, and those of
# speed and size; at the end what was asked and what was measured. Made to take
# less than 30 minutes on two idle cores, once krot and krot_benchmark are built
# (into build/, first; or those in BUILD are taken).
#
# Usage: tools/benchmark/run_all.sh [MODELS] [OUTPUT]
#
# MODELS is a folder of COLMAP models, by default KROT_REAL_MODELS; without it
# synthetic models alone are measured. OUTPUT is a folder for the tables (*.md),
# reports (*.json) and plots (*.gp, for gnuplot); by default they are thrown
# away. Needs 3 GB of memory and 1 GB in TMPDIR. QUICK=1 measures little of
# everything, in a minute or two, to see that it goes through. What fails is
# named on stderr and left out.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
models=${1:-${KROT_REAL_MODELS:-}}
output=${2:-$(mktemp -d)}
mkdir -p "$output"

if [[ -z ${BUILD:-} ]]; then
  # shellcheck source=tools/setup.sh
  source "$here/../setup.sh"
  install_missing "${build_needs[@]}"
  build_krot "$root/build" -DKROT_BUILD_BENCHMARKS=ON
  BUILD=$root/build
fi

# What each part measures: see krot_benchmark COMMAND -h.
triangulation=(--repeats 9 --max_points 300)
blocks=()
known_rotation=(--repeats 1 --time_limit 6)
sweep=(--repeats 5)
scaling=(--max_observations 10000000 --max_sweeps 150)
joint=()
if [[ ${QUICK:-0} == 1 ]]; then
  triangulation=(--repeats 1 --max_points 10)
  blocks=(--repeats 1 --max_points 10 --max_frames 2)
  known_rotation=(--repeats 1 --time_limit 0.2 --synthetic_sizes 1)
  sweep=(--repeats 1 --synthetic_size 1)
  scaling=(--max_observations 10000 --vary 0)
  joint=(--repeats 1)
fi

complain() { printf 'run_all.sh: %s\n' "$*" >&2; }

# How many observations of a model krot can optimise; fails where none.
count_observations() {
  local probe=$output/probe code=0
  "$BUILD/krot" point_triangulator --input_path "$1" --output_path "$probe" \
    --overwrite 1 --log_level 0 --report_path "$probe.txt" \
    >/dev/null 2>&1 || code=$?
  ((code)) || sed -n 's/.*"num_observations": \([0-9]*\).*/\1/p' "$probe.txt"
  rm -rf "$probe" "$probe.txt"
  return "$code"
}

# --input_path M for every folder in $models that tells something.
all=()
if [[ -n $models ]]; then
  for model in "$models"/*/; do
    if count=$(count_observations "$model") && ((count >= 1000)); then
      all+=(--input_path "$model")
    else
      complain "$model is left out: not a model, or of less than 1000" \
        "observations that krot can solve"
    fi
  done
fi
# Of these: the largest few, which are worth a sweep's timing, and those that a
# user could have: tower_init is tower from a start that no COLMAP run leaves.
large=() usual=()
for ((i = 1; i < ${#all[@]}; i += 2)); do
  case $(basename "${all[i]}") in
    tower_init) large+=(--input_path "${all[i]}") ;;
    tower | south128_full) large+=(--input_path "${all[i]}") ;;&
    *) usual+=(--input_path "${all[i]}") ;;
  esac
done

rm -f "$output/elapsed.md"
printf '| part | seconds |\n|---|---:|\n' >"$output/elapsed.new"

# run NAME COMMAND OPTION... : prints, and keeps $output/NAME.*
run() {
  local name=$1 start=$SECONDS code=0
  shift
  rm -f "$output/$name".{md,json,gp}
  "$BUILD/krot_benchmark" "$@" --format markdown \
    --report_path "$output/$name.json" --plot_path "$output/$name.gp" \
    >"$output/$name.new" || code=$?
  if ((code == 0)); then
    mv "$output/$name.new" "$output/$name.md"
    printf '\n' && cat "$output/$name.md"
    printf '\n%s: %d s\n' "$name" $((SECONDS - start))
  else
    rm -f "$output/$name.new"
    complain "$name is left out: krot_benchmark ended with exit code $code" \
      "after $((SECONDS - start)) s"
  fi
  printf '| %s | %d |\n' "$name" $((SECONDS - start)) >>"$output/elapsed.new"
}

begin=$SECONDS
run triangulation triangulation "${triangulation[@]}" "${all[@]}"
run triangulation_inf triangulation --norm inf "${triangulation[@]}" "${all[@]}"
if ((${#all[@]})); then
  run blocks blocks "${blocks[@]}" "${all[@]}"
fi
run known_rotation known_rotation "${known_rotation[@]}" "${all[@]}"
run sweep sweep "${sweep[@]}" "${large[@]}"
run scaling scaling "${scaling[@]}"
if ((${#usual[@]})); then
  command -v colmap >/dev/null || complain "colmap is not there: joint is of" \
    "krot alone"
  run joint joint "${joint[@]}" "${usual[@]}"
fi
printf '| all | %d |\n' $((SECONDS - begin)) >>"$output/elapsed.new"
mv "$output/elapsed.new" "$output/elapsed.md"

printf '\n'
"$BUILD/krot_benchmark" summary --format markdown --report_path "$output" |
  tee "$output/summary.md"
printf '\n' && cat "$output/elapsed.md"
