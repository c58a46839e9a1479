#!/usr/bin/env bash
# Bundle adjustment, KROT against COLMAP, and bounded bundle adjustment, judged
# by COLMAP, on every model below a folder.
#
#   bundle_adjustment.sh KROT MODELS [plain|bounded] [NAME...]
#
# KROT is the executable, MODELS a folder of model folders. `plain` prints per
# model the cost that each side ends at (both evaluated by KROT, px^2) and the
# seconds from start to exit, the median of three interleaved runs; COLMAP runs
# on as many threads as KROT. `bounded` prints per cap factor the cap, the
# largest error, the RMS error, how many observations COLMAP's point_filtering
# finds above the cap, and the seconds.
set -euo pipefail

krot=$(realpath "$1")
models=$(realpath "$2")
mode=${3:-plain}
shift $(($# < 3 ? $# : 3))
names=("$@")
threads=${KROT_BENCHMARK_THREADS:-2}
runs=${KROT_BENCHMARK_RUNS:-3}
factors=${KROT_BENCHMARK_FACTORS:-1.02 1.1 1.5}
export QT_QPA_PLATFORM=offscreen GLOG_minloglevel=2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# seconds COMMAND... runs it and prints how long that took.
seconds() {
  local begin end
  begin=$(date +%s.%N)
  "$@" >"$work/log" 2>&1 || {
    cat "$work/log" >&2
    return 1
  }
  end=$(date +%s.%N)
  awk -v a="$begin" -v b="$end" 'BEGIN { printf "%.3f\n", b - a }'
}

median() { sort -g | awk '{ v[NR] = $1 } END { print v[int((NR + 1) / 2)] }'; }

# value FILE KEY: the first number under the key of a report.
value() { sed -n "s/^ *\"$2\": \([^,]*\),*$/\1/p" "$1" | head -n 1; }

adjust() { # INPUT OUTPUT OPTION...
  "$krot" bundle_adjuster --input_path "$1" --output_path "$2" --overwrite 1 \
    --report_path "$work/report.json" --log_level 0 \
    --BundleAdjustmentCeres.num_threads "$threads" "${@:3}"
}

plain() { # NAME MODEL
  local run cost_colmap cost
  : >"$work/colmap_times"
  : >"$work/krot_times"
  for ((run = 0; run < runs; ++run)); do
    rm -rf "$work/colmap" && mkdir "$work/colmap"
    seconds taskset -c "0-$((threads - 1))" colmap bundle_adjuster \
      --input_path "$2" --output_path "$work/colmap" >>"$work/colmap_times"
    seconds adjust "$2" "$work/krot" >>"$work/krot_times"
  done
  cost=$(value "$work/report.json" cost_final)
  adjust "$work/colmap" "$work/same" \
    --BundleAdjustmentCeres.max_num_iterations 0 >"$work/log"
  cost_colmap=$(value "$work/report.json" cost_initial)
  awk -v name="$1" -v a="$cost_colmap" -v b="$cost" \
    -v s="$(median <"$work/colmap_times")" -v t="$(median <"$work/krot_times")" \
    'BEGIN { printf "%-20s %12.3f %12.3f %9.4f %% %8.2f %8.2f %7.2f\n",
             name, a, b, 100 * (b - a) / a, s, t, t / s }'
}

bounded() { # NAME MODEL
  local factor time filtered
  for factor in $factors; do
    time=$(seconds adjust "$2" "$work/krot" \
      --BundleAdjustment.max_error_factor "$factor") || continue
    rm -rf "$work/filtered" && mkdir "$work/filtered"
    colmap point_filtering --input_path "$work/krot" \
      --output_path "$work/filtered" --min_tri_angle 0 --max_reproj_error \
      "$(value "$work/report.json" max_error)" >"$work/log" 2>&1
    filtered=$(sed -n 's/^Filtered observations: //p' "$work/log")
    awk -v name="$1" -v factor="$factor" -v filtered="$filtered" \
      -v time="$time" '
      /"max_error"/ { gsub(/[ ,]/, "", $2); cap = $2 }
      /"termination"/ { gsub(/[",]/, "", $2); termination = $2 }
      /"num_active"/ { gsub(/,/, "", $2); active = $2 }
      /"after"/ { after = 1 }
      after && /"max"/ { gsub(/,/, "", $2); max = $2 }
      after && /"rms"/ { rms = $2; after = 0 }
      END { printf "%-20s %5s %9.5f %9.5f %9.5f %6d %8s %8.2f  %s\n", name,
            factor, cap, max, rms, active, filtered, time, termination }' \
      "$work/report.json"
  done
}

if [[ $mode == plain ]]; then
  printf '%-20s %12s %12s %11s %8s %8s %7s\n' model "COLMAP cost" "KROT cost" \
    difference "COLMAP s" "KROT s" ratio
else
  printf '%-20s %5s %9s %9s %9s %6s %8s %8s  %s\n' model factor cap max RMS \
    active filtered seconds termination
fi
if ((${#names[@]} == 0)); then
  for folder in "$models"/*/; do names+=("$(basename "$folder")"); done
fi
for name in "${names[@]}"; do "$mode" "$name" "$models/$name"; done
