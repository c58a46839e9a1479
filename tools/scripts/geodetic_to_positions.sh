#!/usr/bin/env bash
# Geodetic coordinates (GPS, WGS84) to a file for `krot solver --positions_path`
# in a local frame: x to the east, y to the north, z up, metres, with its origin
# at a place of yours. The model has to be in that frame; that of COLMAP's
# `model_aligner --ref_is_gps 1 --alignment_type enu` has its origin at the
# first image of the list.
#
# Usage: geodetic_to_positions.sh --origin "LATITUDE LONGITUDE HEIGHT" \
#          --input_path FILE --output_path FILE
#
# The input has per line a NAME without blanks, LATITUDE and LONGITUDE in
# degrees, HEIGHT above the ellipsoid in metres, and a RADIUS or three semi-axes
# (east, north, up) in metres. Needs CartConvert of GeographicLib [Karney].
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/common.sh"

parse_options "origin input_path output_path" "$@"
((${#others[@]} == 0)) || die "${others[0]} is unknown; -h shows the usage"
require_options origin input_path output_path
file=${option[input_path]}
output=${option[output_path]}
[[ -f $file ]] || die "--input_path $file is not a file"
[[ ! -e $output ]] || die "--output_path $output exists"
command -v CartConvert >/dev/null \
  || die "CartConvert is missing: apt install geographiclib-tools"
read -r -a origin <<<"${option[origin]}"
((${#origin[@]} == 3)) || die "--origin needs LATITUDE LONGITUDE HEIGHT"

# Complete, or not there.
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export LC_ALL=C  # numbers with points
grep -Ev '^[[:space:]]*(#|$)' "$file" >"$work/lines" \
  || die "$file: found no position, expected one on a line each"
awk -v file="$file" 'NF != 5 && NF != 7 {
  printf "%s: found \"%s\", expected NAME LATITUDE LONGITUDE HEIGHT and RADIUS or three semi-axes\n",
    file, $0 > "/dev/stderr"
  exit 1
}' "$work/lines" || exit 1
awk '{ print $2, $3, $4 }' "$work/lines" \
  | CartConvert -l "${origin[@]}" -p 6 >"$work/local" || true
if grep -n '^ERROR' "$work/local" >"$work/errors"; then
  die "$file: $(head -1 "$work/errors" | cut -d: -f2-)"
fi
[[ $(wc -l <"$work/local") == $(wc -l <"$work/lines") ]] \
  || die "--origin ${option[origin]} is no place on the ellipsoid"
paste -d' ' <(awk '{ print $1 }' "$work/lines") "$work/local" \
  <(awk '{ $1 = $2 = $3 = $4 = ""; sub(/^ +/, ""); print }' "$work/lines") \
  >"$work/positions"
mv "$work/positions" "$output" || die "cannot write to $output"
echo "Wrote $(wc -l <"$output") positions to $output"
