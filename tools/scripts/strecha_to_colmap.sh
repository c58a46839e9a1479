#!/usr/bin/env bash
# Surveyed cameras of Strecha et al. (CVPR 2008) to a COLMAP model in text form,
# without points: PINHOLE cameras and the poses of the images.
#
# Usage: strecha_to_colmap.sh --input_path FOLDER --output_path MODEL
#
# FOLDER holds a file NAME.camera for each image NAME (0000.jpg.camera, ...):
# the three rows of K; a row of distortion, which must be zero; the three rows
# of R, whose columns are the camera's axes in the world; the centre; width and
# height. The principal point is taken over as it stands.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/common.sh"

parse_options "input_path output_path" "$@"
((${#others[@]} == 0)) || die "${others[0]} is unknown; -h shows the usage"
require_options input_path output_path
shopt -s nullglob
files=("${option[input_path]}"/*.camera)
((${#files[@]})) || die "--input_path ${option[input_path]} holds no *.camera"

model=${option[output_path]}
for name in cameras images points3D; do
  for type in bin txt; do
    [[ ! -e $model/$name.$type ]] || die "$model already holds $name.$type"
  done
done
for file in "${files[@]}"; do
  [[ -s $file ]] || die "$file is empty"
done

# Complete, or not there.
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export LC_ALL=C  # numbers with points
awk -v cameras="$work/cameras.txt" -v images="$work/images.txt" \
  -f "$here/strecha_to_colmap.awk" "${files[@]}"
: >"$work/points3D.txt"
mkdir -p "$model" || die "cannot write to $model"
mv "$work"/*.txt "$model"
echo "Wrote ${#files[@]} cameras to $model"
