#!/usr/bin/env bash
# What `krot solver` announces that it will need and what it takes, in MB, for
# every model below a folder, from its own start and from nothing.
#
#   announced_memory.sh KROT MODELS
#
# `announced`: what will be needed, and at most, where that is more; `peak`: the
# largest resident set. Solves that end without a model are left out.
set -euo pipefail

krot=$(realpath "$1")
models=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# In MB: "241.7 MB", "1.2 GB".
megabytes() { awk '{ print $2 == "GB" ? 1000 * $1 : $2 == "KB" ? $1 / 1000 : $1 }'; }

cat <<'TABLE'
| model | start | announced | at most | peak | announced / peak |
|---|---|---:|---:|---:|---:|
TABLE
for model in "$models"/*/; do
  for init in model feasible; do
    "$krot" solver --input_path "$model" --output_path "$work/output" \
      --overwrite 1 --Solver.init "$init" --report_path "$work/report.json" \
      >/dev/null 2>"$work/log" || continue
    announced=$(sed -n 's/.*; about \([0-9.]* .B\) will be needed.*/\1/p' \
      "$work/log" | megabytes)
    at_most=$(sed -n 's/.* at most \([0-9.]* .B\) if the joint.*/\1/p' \
      "$work/log" | megabytes)
    [[ -n $announced ]] || continue
    jq -r --arg name "$(basename "$model")" --arg init "$init" \
      --arg announced "$announced" --arg at_most "${at_most:--}" '
      (.peak_memory_bytes / 1e6) as $peak
      | "| \($name) | \($init) | \($announced) | \($at_most)"
        + " | \($peak * 10 | round / 10)"
        + " | \(($announced | tonumber) / $peak * 100 | round / 100) |"' \
      "$work/report.json"
  done
done
