#!/usr/bin/env bash
# Makes docs/images/sample_result.svg: how many observations of the bundled
# sample have an error above x pixels, before and after `krot solver`. Solves
# the sample with build/krot, or with the executable in KROT. Needs awk, jq
# and gnuplot.
#
# Usage: tools/docs/sample_result.sh
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)
krot=${KROT:-$root/build/krot}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# errors MODEL: "rank error" of its pixel errors, largest first; of ranks that
# lie close on a logarithmic axis one is enough.
errors() {
  "$krot" model_analyzer --path "$1" --num_worst 1000000 \
    --report_path "$work/report.json" --log_level 0 >/dev/null
  jq '.worst[].error_px' "$work/report.json" | awk '{
    if (++rank < next_rank) next
    next_rank = rank * 1.03
    print rank, $1
  }'
}

"$krot" solver --input_path "$root/tools/sample/model" \
  --output_path "$work/solved" --log_level 0 >/dev/null
errors "$root/tools/sample/model" >"$work/before"
errors "$work/solved" >"$work/after"
gnuplot -e "folder='$work'" "$here/error_tails.gp" \
  >"$root/docs/images/sample_result.svg"
