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
# The input has per line a NAME, LATITUDE and LONGITUDE in degrees, HEIGHT above
# the ellipsoid in metres, and a RADIUS, three semi-axes (east, north, up) in
# metres, or nothing (krot solver --Problem.position_radius), between blanks,
# tabs, commas or semicolons. A line of words in front of all is a header. Needs
# CartConvert of GeographicLib [Karney].
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/common.sh"

parse_options "origin input_path output_path" "$@"
((${#others[@]} == 0)) || die "${others[0]} is unknown; -h shows the usage"
require_options origin input_path output_path
file=${option[input_path]}
output=${option[output_path]}
[[ -f $file ]] || die "--input_path $file is not a file"
require_text "$file"
[[ ! -e $output ]] || die "--output_path $output exists"
command -v CartConvert >/dev/null \
  || die "CartConvert is missing: apt install geographiclib-tools"
read -r -a origin <<<"${option[origin]}"
((${#origin[@]} == 3)) || die "--origin needs LATITUDE LONGITUDE HEIGHT"

# Complete, or not there.
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export LC_ALL=C  # numbers with points
# Lines of NAME, a tab and the numbers.
awk -v file="$file" '
  function refuse(expected) {
    printf "%s: found \"%s\", expected %s\n", file, $0, expected > "/dev/stderr"
    has_failed = 1
    exit 1
  }
  NR == 1 { sub(/^\357\273\277/, "") }  # a byte order mark
  { sub(/\r$/, "") }
  /^[ \t]*(#|$)/ { next }
  /(^|[ \t;])[-+]?[0-9]+,[0-9]+([ \t;]|$)/ { refuse("decimal points, no commas") }
  {
    name = $0
    numbers = ""
    for (count = 0; match(name,
        /[ \t,;"]+[-+]?[0-9.]+([eE][-+]?[0-9]+)?[ \t,;"]*$/); ++count) {
      number = substr(name, RSTART)
      name = substr(name, 1, RSTART - 1)
      gsub(/[ \t,;"]/, "", number)
      numbers = number " " numbers
    }
    gsub(/^[ \t,;"]+|[ \t,;"]+$/, "", name)
    if (count == 0 && !num_lines && !has_header) {
      has_header = 1
      next
    }
    if (count != 3 && count != 4 && count != 6) {
      refuse("NAME LATITUDE LONGITUDE HEIGHT and RADIUS or three semi-axes")
    }
    ++num_lines
    print name "\t" numbers
  }
  END {
    if (!num_lines && !has_failed) {
      printf "%s: found no position, expected one on a line each\n", file \
        > "/dev/stderr"
      exit 1
    }
  }' "$file" >"$work/lines" || exit 1
cut -f2 "$work/lines" | awk '{ print $1, $2, $3 }' \
  | CartConvert -l "${origin[@]}" -p 6 >"$work/local" || true
if grep -n '^ERROR' "$work/local" >"$work/errors"; then
  die "$file: $(head -1 "$work/errors" | cut -d: -f2-); the latitude comes first"
fi
[[ $(wc -l <"$work/local") == $(wc -l <"$work/lines") ]] \
  || die "--origin ${option[origin]} is no place on the ellipsoid"
paste -d' ' <(cut -f1 "$work/lines") "$work/local" \
  <(cut -f2 "$work/lines" | awk '{ $1 = $2 = $3 = ""; sub(/^ +/, ""); print }') \
  | sed 's/ *$//' >"$work/positions"
mv "$work/positions" "$output" || die "cannot write to $output"
echo "Wrote $(wc -l <"$output") positions to $output"
