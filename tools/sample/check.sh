#!/usr/bin/env bash
# Shows that a model and its ground truth are the same cameras: one similarity
# takes the model's camera centres onto the true ones and its rotations with
# them. Prints the residuals; fails above 1e-3 of the scene's size (the RMS
# distance of the centres to their mean), 0.1 degrees, or 0.5 % of the focal
# length. Needs colmap (to read the binary model).
#
# Usage: tools/sample/check.sh [MODEL]   (MODEL also holds ground_truth.txt)
set -euo pipefail

sample=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
model=${1:-$sample/model}
text=$(mktemp -d)
trap 'rm -rf "$text"' EXIT
export QT_QPA_PLATFORM=offscreen
colmap model_converter --input_path "$model" --output_path "$text" \
  --output_type TXT >/dev/null
awk -f "$sample/align.awk" \
  "$model/ground_truth.txt" "$text/cameras.txt" "$text/images.txt"
