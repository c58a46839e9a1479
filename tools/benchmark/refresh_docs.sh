#!/usr/bin/env bash
# Puts what run_all.sh printed into docs/benchmarks.md, and its plots into
# docs/images. A table stands there between the lines
#
#   <!-- begin NAME --> and <!-- end NAME -->
#
# and is replaced by OUTPUT/NAME.md where that exists. Needs awk.
#
# Usage: tools/benchmark/run_all.sh MODELS OUTPUT
#        tools/benchmark/refresh_docs.sh OUTPUT
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
output=${1:?"usage: refresh_docs.sh OUTPUT"}
document=$root/docs/benchmarks.md
refreshed=$(mktemp)
trap 'rm -f "$refreshed"' EXIT

awk -v output="$output" '
  /^<!-- begin [a-z_]+ -->$/ {
    print
    file = output "/" $3 ".md"
    is_replaced = (getline line < file) > 0
    if (is_replaced) {
      print ""
      do { print line } while ((getline line < file) > 0)
      print ""
    }
    next
  }
  /^<!-- end [a-z_]+ -->$/ { is_replaced = 0 }
  !is_replaced { print }
' "$document" >"$refreshed"
cat "$refreshed" >"$document"
for name in triangulation triangulation_inf known_rotation scaling; do
  if [[ -s $output/$name.svg ]]; then
    cp "$output/$name.svg" "$root/docs/images/benchmark_$name.svg"
  fi
done
