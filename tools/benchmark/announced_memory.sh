#!/usr/bin/env bash
# What `krot solver` announces that it will need and what it takes, in MB, for
# every model below a folder, from its own start and from nothing.
#
#   announced_memory.sh KROT MODELS
#
# `announced`: what will be needed; `peak`: the largest resident set. Solves that end
# without a model are left out.
set -euo pipefail

krot=$(realpath "$1")
models=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cat <<'TABLE'
| model | start | announced | peak | announced / peak |
|---|---|---:|---:|---:|
TABLE
for model in "$models"/*/; do
  for init in model feasible; do
    "$krot" solver --input_path "$model" --output_path "$work/output" \
      --overwrite 1 --Solver.init "$init" --report_path "$work/report.json" \
      --log_level 0 >/dev/null 2>&1 || continue
    jq -r --arg name "$(basename "$model")" --arg init "$init" '
      def megabytes: . / 1e5 | round / 10;
      .announced_memory_bytes as $announced
      | "| \($name) | \($init) | \($announced | megabytes)"
        + " | \(.peak_memory_bytes | megabytes)"
        + " | \($announced / .peak_memory_bytes * 100 | round / 100) |"' \
      "$work/report.json"
  done
done
