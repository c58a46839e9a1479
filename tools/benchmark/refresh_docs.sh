#!/usr/bin/env bash
# Puts what run_all.sh printed into docs/benchmarks.md and
# docs/history/benchmarks.md, and its plots into docs/images. A table stands
# there between the lines
#
#   <!-- begin NAME --> and <!-- end NAME -->
#
# and is replaced by OUTPUT/NAME.md where that exists, but for its <details>,
# which the JSON beside it holds. Needs awk and, for the plots, gnuplot.
#
# Usage: tools/benchmark/run_all.sh MODELS OUTPUT
#        tools/benchmark/refresh_docs.sh OUTPUT
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
output=${1:?"usage: refresh_docs.sh OUTPUT"}
refreshed=$(mktemp)
trap 'rm -f "$refreshed"' EXIT

for document in "$root"/docs/{,history/}benchmarks.md; do
  awk -v output="$output" '
  /^<!-- begin [a-z_]+ -->$/ {
    print
    file = output "/" $3 ".md"
    is_replaced = (getline line < file) > 0
    if (is_replaced) {
      print ""
      do {
        if (line ~ /^<details>/) is_detail = 1
        if (!is_detail) print line
        else if (line ~ /^<\/details>/) { is_detail = 0; getline line < file }
      } while ((getline line < file) > 0)
      print ""
    }
    next
  }
  /^<!-- end [a-z_]+ -->$/ { is_replaced = 0 }
  !is_replaced { print }
' "$document" >"$refreshed"
  cat "$refreshed" >"$document"
done
for name in triangulation triangulation_inf known_rotation scaling; do
  if [[ -s $output/$name.gp ]]; then
    gnuplot "$output/$name.gp" >"$root/docs/images/benchmark_$name.svg"
  fi
done
