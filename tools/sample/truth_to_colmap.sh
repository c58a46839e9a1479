#!/usr/bin/env bash
# The sample's ground truth as a COLMAP model in text form, without points: what
# krot model_comparer takes as --input_path1.
#
# Usage: tools/sample/truth_to_colmap.sh OUTPUT [GROUND_TRUTH]
#   GROUND_TRUTH: tools/sample/model/ground_truth.txt if not given
set -euo pipefail

[[ $# -eq 1 || $# -eq 2 ]] ||
  { echo "Usage: $0 OUTPUT [GROUND_TRUTH]" >&2; exit 1; }
sample=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
truth=${2:-$sample/model/ground_truth.txt}
[[ -r $truth ]] || { echo "$0: $truth cannot be read" >&2; exit 1; }
mkdir -p "$1"
awk '$1 == "CAMERA" { $1 = 1; print }' "$truth" >"$1/cameras.txt"
awk '/^[^#]/ && $1 != "CAMERA" { print ++n, $2, $3, $4, $5, $6, $7, $8, 1, $1
  print "" }' "$truth" >"$1/images.txt"
: >"$1/points3D.txt"
