#!/usr/bin/env bash
# Renders the sample's views and writes their exact cameras:
#   OUTPUT/images/view01.png ... view24.png, OUTPUT/ground_truth.txt, and a small
#   picture for the documentation, OUTPUT/sample_view.jpg.
# Needs povray. About two minutes on one core.
#
# Usage: tools/sample/render.sh OUTPUT
set -euo pipefail

[[ $# -eq 1 ]] || { echo "Usage: $0 OUTPUT" >&2; exit 1; }
sample=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
mkdir -p "$1/images"
cd "$1"

# Runs POV-Ray quietly; its messages are shown only if it fails.
pov() {
  local log
  log=$(povray "+L$sample" -D -GA "$@" 2>&1) || { echo "$log" >&2; exit 1; }
}

# cameras.inc holds the image size and the number of views.
constant() {
  awk -v name="$1" '$2 == name { print $4 + 0; exit }' "$sample/cameras.inc"
}
width=$(constant Width)
height=$(constant Height)
num_views=$(constant Num_views)

pov "+I$sample/ground_truth.pov" +W1 +H1 -F
for ((view = 1; view <= num_views; ++view)); do
  printf 'Rendering view %d of %d\n' "$view" "$num_views"
  # -J: no jitter, so that a second rendering gives the same pixels.
  pov "+I$sample/scene.pov" +Oimages/view.png +FN "+W$width" "+H$height" \
    +KFI1 "+KFF$num_views" "+SF$view" "+EF$view" +A0.1 +AM2 +R2 -J +WT1
done
pov "+I$sample/scene.pov" +Osample_view.jpg +FJ85 +W720 +H540 \
  "+KFF$num_views" +SF12 +EF12 +A0.1 +AM2 +R3 -J +WT1
mv sample_view12.jpg sample_view.jpg
