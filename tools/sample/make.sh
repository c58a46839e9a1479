#!/usr/bin/env bash
# Remakes the sample: renders the views, reconstructs them with COLMAP, checks
# the result against the ground truth and installs it in tools/sample/model,
# tools/sample/database.db and docs/images. All else, the images included,
# stays in the folder WORK.
#
# Usage: tools/sample/make.sh WORK
set -euo pipefail

[[ $# -eq 1 ]] || { echo "Usage: $0 WORK" >&2; exit 1; }
sample=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
mkdir -p "$1"
work=$(cd "$1" && pwd)
max_bytes=4000000

"$sample/render.sh" "$work"
"$sample/reconstruct.sh" "$work/images" "$work/sparse"

model=$work/sparse/0
cp "$work/ground_truth.txt" "$model"
"$sample/check.sh" "$model"

# COLMAP's project.ini stays behind: it names folders of this machine.
files=(cameras.bin images.bin points3D.bin ground_truth.txt)
bytes=$(cd "$model" && cat "${files[@]}" | wc -c)
if ((bytes > max_bytes)); then
  echo "$0: the model has $bytes bytes, must be <= $max_bytes" >&2
  exit 1
fi
"$sample/slim_database.py" "$work/sparse/database.db" "$sample/database.db"
mkdir -p "$sample/model" "$sample/../../docs/images"
(cd "$model" && cp "${files[@]}" "$sample/model")
cp "$work/sample_view.jpg" "$sample/../../docs/images/sample_view.jpg"
echo "Installed $bytes bytes in $sample/model"
