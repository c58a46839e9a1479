#!/usr/bin/env bash
# The certified optimum of every model below a folder, as a table.
#
#   certified.sh KROT MODELS
#
# Per model rounds, sweeps, iterations of the joint solver, the percentage of
# the observations that its last working set has, iterations of the finish,
# seconds of the whole command, the largest true error of the input and the
# lowest that was reached, the bound that is proved of true errors, how far the
# former is above the latter, relative, and how many observations prove it.
# Models that end with another exit code than 0 are left out.
set -euo pipefail

krot=$(realpath "$1")
models=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cat <<'TABLE'
| model | rounds | sweeps | iterations | set | finish | s | before | lowest | bound | gap | support |
|---|---|---|---|---|---|---|---|---|---|---|---|
TABLE
for model in "$models"/*/; do
  "$krot" solver --input_path "$model" --output_path "$work/output" \
    --overwrite 1 --report_path "$work/report.json" --log_level 0 \
    >"$work/log" 2>&1 || continue
  jq -r --arg name "$(basename "$model")" '
    def digits(n):
      if . == null then "-" else . * pow(10; n) | round / pow(10; n) end;
    (.finish.lowest_cost // .cost_final) as $lowest
    | (.lower_bound // 0) as $bound
    | "| \($name) | \(.rounds | length) | \(.sweeps | length)"
      + " | \([.iterations[] | select(.method == "joint")] | length)"
      + " | \((.working_observations // 0) / ([.num_observations, 1] | max)
              | . * 100 | digits(1)) %"
      + " | \(.finish.num_iterations // "-") | \(.seconds.total | digits(2))"
      + " | \(.pixel_error.before.max | digits(4)) | \($lowest | digits(5))"
      + " | \($bound | digits(5))"
      + " | \(if $bound > 0 then ($lowest - $bound) / $lowest | digits(7)
              else "-" end)"
      + " | \(.support | length) |"' "$work/report.json"
done
