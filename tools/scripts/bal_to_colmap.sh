#!/usr/bin/env bash
# A problem of Agarwal et al., Bundle Adjustment in the Large (ECCV 2010), to a
# COLMAP model in text form.
#
# Usage: bal_to_colmap.sh --input_path FILE --output_path MODEL
#
# FILE is a problem-*.txt, unpacked: the numbers of cameras, points and
# observations; per observation camera, point, x and y; nine numbers per camera
# (rotation vector, translation, f, k1, k2) and three per point. Cameras there
# look along -z with y upwards; here both change their signs. Every camera
# becomes a RADIAL one, with the image's middle as its principal point; images
# are as large as the farthest observation asks for, as the file says no size.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/common.sh"

parse_options "input_path output_path" "$@"
((${#others[@]} == 0)) || die "${others[0]} is unknown; -h shows the usage"
require_options input_path output_path
file=${option[input_path]}
[[ -f $file ]] || die "--input_path $file is not a file"
require_text "$file"

model=${option[output_path]}
for name in cameras images points3D; do
  for type in bin txt; do
    [[ ! -e $model/$name.$type ]] || die "$model already holds $name.$type"
  done
done

# Complete, or not there.
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export LC_ALL=C  # numbers with points
awk -v folder="$work" -f "$here/bal_to_colmap.awk" "$file"
mkdir -p "$model" || die "cannot write to $model"
mv "$work"/*.txt "$model"
echo "Wrote $(grep -c . "$model/cameras.txt") cameras to $model"
