#!/usr/bin/env bash
# What the finish makes of the lowest maximum, on every model below a folder.
#
#   finish.sh KROT MODELS [NAME...]
#
# KROT is the executable, MODELS a folder of model folders. Prints per model the
# largest error of the input, the lowest that was reached and that of the result;
# mean errors of the input, with --Solver.finish none and with the default; RMS
# errors of the same and of the bounded adjustment with the same unknowns below the
# same cap (krot bundle_adjuster, from the result of --Solver.finish none, by
# another barrier, on other derivatives and another start); iterations of
# the finish, its seconds, and those as a share of all before them: medians of
# KROT_BENCHMARK_RUNS runs. Models without a certified optimum,
# or from which observations had to be removed, are left out.
set -euo pipefail

krot=$(realpath "$1")
models=$(realpath "$2")
shift 2
names=("$@")
runs=${KROT_BENCHMARK_RUNS:-3}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

solve() { # MODEL RESULT OPTION...
  "$krot" solver --input_path "$1" --output_path "$work/$2" --overwrite 1 \
    --report_path "$work/$2.json" --log_level 0 "${@:3}" >"$work/log" 2>&1
}

# value RESULT JQ-PATH, as a number or nothing.
value() { jq -r "$2 // empty" "$work/$1.json"; }

median() { sort -g | awk '{ v[NR] = $1 } END { print v[int((NR + 1) / 2)] }'; }

row() { # NAME MODEL
  local run cap bounded
  : >"$work/seconds"
  : >"$work/shares"
  for ((run = 0; run < runs; ++run)); do
    solve "$2" default || return 0
    [[ $(value default .finish.cap) ]] || return 0
    [[ -z $(value default .outliers.max_error) ]] || return 0
    value default .finish.seconds >>"$work/seconds"
    value default '.finish.seconds / (.seconds.solve - .finish.seconds)' \
      >>"$work/shares"
  done
  solve "$2" none --Solver.finish none || return 0
  cap=$(value default .finish.cap)
  bounded=-
  if "$krot" bundle_adjuster --input_path "$work/none" \
    --output_path "$work/bounded" --overwrite 1 --log_level 0 \
    --report_path "$work/bounded.json" --BundleAdjustment.max_error "$cap" \
    --BundleAdjustment.constant_rig_from_world_rotation 1 \
    --BundleAdjustment.refine_sensor_from_rig 0 \
    --BundleAdjustment.refine_focal_length 0 \
    --BundleAdjustment.refine_extra_params 0 >"$work/log" 2>&1; then
    bounded=$(value bounded '.pixel_error.after.rms' | xargs printf '%.4f')
  fi
  printf '| %s | %.4f | %.4f | %.4f | %.3f | %.3f | **%.3f** | %.4f | %.4f | %.4f | %s | %d | %.2f | %.2f |\n' \
    "$1" "$(value default .pixel_error.before.max)" \
    "$(value default .finish.lowest_cost)" \
    "$(value default .pixel_error.after.max)" \
    "$(value default .pixel_error.before.mean)" \
    "$(value none .pixel_error.after.mean)" \
    "$(value default .pixel_error.after.mean)" \
    "$(value default .pixel_error.before.rms)" \
    "$(value none .pixel_error.after.rms)" \
    "$(value default .pixel_error.after.rms)" "$bounded" \
    "$(value default .finish.num_iterations)" \
    "$(median <"$work/seconds")" "$(median <"$work/shares")"
}

cat <<'TABLE'
| model | max before | lowest | after | mean before | none | finish | RMS before | none | finish | bounded | iterations | s | of the solve |
|---|---|---|---|---|---|---|---|---|---|---|---|---|---|
TABLE
for model in "$models"/*/; do
  name=$(basename "$model")
  if ((${#names[@]} > 0)) && [[ ! " ${names[*]} " == *" $name "* ]]; then
    continue
  fi
  row "$name" "$model"
done
