#!/usr/bin/env bash
# Makes the figures of docs/method, docs/images/method_*.svg. Needs awk.
#
# Usage: tools/docs/method_figures.sh
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
for figure in sweep matrix working_set; do
  awk -v figure="$figure" -f "$here/method_figures.awk" \
    >"$here/../../docs/images/method_$figure.svg"
done
