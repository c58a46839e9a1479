#!/usr/bin/env bash
# How far the optima that several builds of krot find are from each other, as
# compilers and their options round differently: the largest and the smallest
# lowest maximum, relative, per model, and the bounds. Sweeps alone are compared
# too, with ten of them.
#
# Usage: same_costs.sh DATA NAME[,NAME...] KROT KROT...
set -euo pipefail

(($# >= 4)) || {
  sed -n '2,7p' "${BASH_SOURCE[0]}" >&2
  exit 1
}
data=$1
IFS=, read -r -a names <<<"$2"
shift 2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# costs KEY OPTION... : of every build.
costs() {
  local key=$1 krot
  shift
  for krot in "${krots[@]}"; do
    "$krot" solver --input_path "$data/$name" --output_path "$work/output" \
      --overwrite 1 --report_path "$work/report.json" --log_level 0 "$@" \
      >/dev/null 2>&1 || true
    jq -r "$key" "$work/report.json"
  done
}

# Of numbers on stdin: (largest - smallest) / largest.
spread() {
  sort -g | awk 'NR == 1 { least = $1 } { most = $1 }
    END { printf "%.1e", (most > 0 ? (most - least) / most : 0) }'
}

krots=("$@")
printf '| model | lowest maximum | bound | ten sweeps |\n|---|---|---|---|\n'
for name in "${names[@]}"; do
  tight=(--Solver.relative_gap 1e-9 --Solver.finish none)
  printf '| %s | %s | %s | %s |\n' "$name" \
    "$(costs .cost_final "${tight[@]}" | spread)" \
    "$(costs .lower_bound "${tight[@]}" | spread)" \
    "$(costs .cost_final --Solver.method res_int --ResInt.max_sweeps 10 \
      | spread)"
done
