#!/usr/bin/env bash
# Bundle adjustment and the lowest maximum, from the same COLMAP model, in one
# table: the pixel errors of every result and how far its cameras are from the
# model's own, or from the true ones.
#
# Usage: compare_linf_with_ba.sh --input_path MODEL --output_path FOLDER
#   --truth_path MODEL    a COLMAP model of the true cameras; images are
#                         matched by name, it needs no points
#   --max_error_factor F  the cap of bounded bundle adjustment, as a multiple
#                         of the lowest maximum; 1.1 if not given
#
# FOLDER takes the models (colmap_ba, ba, cauchy, ba_rotations, bounded, linf,
# linf_cauchy, linf_only), and in FOLDER/reports what each command said and a report of each comparison.
# Results already there are replaced. Needs colmap, jq and krot: the one that the
# environment's KROT names, that is built here, or that is installed.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

parse_options "input_path output_path truth_path max_error_factor" "$@"
((${#others[@]} == 0)) || die "${others[0]} is unknown; -h shows the usage"
require_options input_path output_path
require_model input_path
[[ -z ${option[truth_path]:-} ]] || require_model truth_path
require_programs colmap jq
find_krot

input=${option[input_path]}
output=${option[output_path]}
truth=${option[truth_path]:-}
factor=${option[max_error_factor]:-1.1}
reports=$output/reports
mkdir -p "$output/colmap_ba" "$reports" || die "cannot write to $output"

# adjust NAME COMMAND OPTION... makes the model FOLDER/NAME.
adjust() {
  local name=$1
  shift
  printf 'making %s\n' "$name" >&2
  quietly "$reports/$name.log" "$@" --input_path "$input" \
    --output_path "$output/$name"
}

krot_ba=("$krot" bundle_adjuster --overwrite 1)
adjust colmap_ba colmap bundle_adjuster
rm -f "$reports/certificate.json"  # there may be none this time
adjust linf "$krot" solver --overwrite 1 \
  --certificate_path "$reports/certificate.json"
adjust linf_cauchy "$krot" solver --overwrite 1 --Solver.finish_loss cauchy
adjust linf_only "$krot" solver --overwrite 1 --Solver.finish none
adjust ba "${krot_ba[@]}"
adjust cauchy "${krot_ba[@]}" --BundleAdjustmentCeres.loss_function_type CAUCHY
adjust ba_rotations "${krot_ba[@]}" \
  --BundleAdjustment.constant_rig_from_world_rotation 1 \
  --BundleAdjustment.refine_focal_length 0 \
  --BundleAdjustment.refine_extra_params 0
adjust bounded "${krot_ba[@]}" --BundleAdjustment.max_error_factor "$factor"

# row MODEL NAME LABEL prints a line of the table.
row() {
  local report=$reports/$2.json against=("$input" --alignment frame)
  [[ -z $truth ]] || against=("$truth" --alignment similarity)
  quietly "$reports/$2_compared.log" "$krot" model_comparer \
    --input_path1 "${against[@]}" --input_path2 "$1" --report_path "$report"
  local figures
  read -ra figures < <(jq -r '[.pixel_error.model2
    | .max, .p99, .mean, .rms] + [.center.rms, .center.max, .rotation_deg.max]
    | @tsv' "$report")
  printf '%-30s %8.4f %7.4f %7.4f %7.4f  %9.6f %9.6f %8.4f\n' \
    "$3" "${figures[@]}"
}

# Numbers are printed and read with points.
export LC_ALL=C
if [[ -n $truth ]]; then
  echo "Cameras: against the truth, after the similarity that fits their centres"
else
  echo "Cameras: against the input, in its own frame"
fi
printf '%-30s %8s %7s %7s %7s  %9s %9s %8s\n' \
  '' 'max, px' P99 mean RMS 'centre: RMS' max 'degrees'
row "$input" input "input"
row "$output/colmap_ba" colmap_ba "colmap bundle_adjuster"
row "$output/ba" ba "bundle adjustment"
row "$output/cauchy" cauchy "  Cauchy loss"
row "$output/ba_rotations" ba_rotations "  rotations, intrinsics kept"
row "$output/bounded" bounded "  bounded, $factor x the lowest"
row "$output/linf" linf "lowest maximum"
row "$output/linf_cauchy" linf_cauchy "  finish with Cauchy loss"
row "$output/linf_only" linf_only "  no finish"
jq -r '"Centres are in units of a scene in which the cameras are \(.scene_radius
  * 1e4 | round / 1e4) from their centroid (RMS)."' "$reports/input.json"
