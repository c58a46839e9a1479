#!/usr/bin/env bash
# Camera centres from photos against a survey: the textbook experiment on the
# scenes of Strecha et al. (CVPR 2008), K given.
#
# Usage: surveyed_scenes.sh --input_path SCENES --output_path FOLDER
#
# SCENES is the folder Benchmarking_Camera_Calibration_2008 of
# https://github.com/openMVG/SfM_quality_evaluation, which you fetch; a scene is
# a folder with images/*.jpg, images/K.txt and gt_dense_cameras/*.camera.
# FOLDER takes a folder for each; steps that ended there are not repeated.
#
# Prints the mean distance of the centres from the survey after the similarity
# that fits best, mm: of COLMAP's mapper; of KROT's positions from the mapper's
# rotations and the matches alone; of these without wrong observations and
# adjusted, as model_checker says; of KROT's positions from the surveyed
# rotations. Minutes and seconds are processor time. Needs colmap, jq and krot.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../scripts/common.sh"

parse_options "input_path output_path" "$@"
((${#others[@]} == 0)) || die "${others[0]} is unknown; -h shows the usage"
require_options input_path output_path
require_programs colmap jq
find_krot
TIMEFORMAT='%U'

# step NAME COMMAND... runs a step of a scene, unless it ended before.
step() {
  local name=$output/$1
  shift
  [[ -e $name.seconds ]] && return
  { time quietly "$name.log" "$@" 2>&3; } 3>&2 2>"$name.time"
  mv "$name.time" "$name.seconds"
}

# from_rotations NAME OPTION... makes a model from rotations and matches.
from_rotations() {
  step "$1" "$krot" solver --input_path "$mapped" \
    --output_path "$output/$1" --overwrite 1 --Solver.init feasible \
    --database_path "$output/database.db" "${@:2}"
}

# mean_mm MODEL
mean_mm() {
  quietly "$1.compared.log" "$krot" model_comparer --alignment similarity \
    --input_path1 "$output/truth" --input_path2 "$1" --report_path "$1.json"
  jq '.center.mean * 1000' "$1.json" | xargs printf '%.2f'
}

minutes() { awk '{ sum += $1 } END { printf "%.0f", sum / 60 }' "$@"; }

echo "| scene | images | COLMAP's mapper | KROT, its rotations | adjusted | KROT, surveyed rotations | features, matches: minutes | mapper: s | KROT: s |"
echo "|---|---|---|---|---|---|---|---|---|"
for scene in "${option[input_path]}"/*/; do
  scene=${scene%/}
  [[ -d $scene/gt_dense_cameras && -r $scene/images/K.txt ]] || continue
  output=${option[output_path]}/$(basename "$scene")
  mapped=$output/sparse/0
  mkdir -p "$output/sparse"
  printf 'reconstructing %s\n' "$scene" >&2
  read -r -a K <<<"$(tr -c '0-9.eE+-' ' ' <"$scene/images/K.txt" | tr -s ' ')"
  # 8,192 features leave none of the octave below the first.
  step features colmap feature_extractor \
    --database_path "$output/database.db" --image_path "$scene/images" \
    --ImageReader.single_camera 1 --ImageReader.camera_model PINHOLE \
    --ImageReader.camera_params "${K[0]},${K[4]},${K[2]},${K[5]}" \
    --SiftExtraction.use_gpu 0 --SiftExtraction.first_octave 0
  step matches colmap exhaustive_matcher \
    --database_path "$output/database.db" --SiftMatching.use_gpu 0
  step mapper colmap mapper --database_path "$output/database.db" \
    --image_path "$scene/images" --output_path "$output/sparse" \
    --Mapper.ba_refine_focal_length 0 --Mapper.ba_refine_principal_point 0 \
    --Mapper.ba_refine_extra_params 0 --Mapper.multiple_models 0
  step truth "$(dirname "${BASH_SOURCE[0]}")/../scripts/strecha_to_colmap.sh" \
    --input_path "$scene/gt_dense_cameras" --output_path "$output/truth"
  awk '!/^#/ && NF == 10 { print $10, $2, $3, $4, $5 }' \
    "$output/truth/images.txt" >"$output/rotations.txt"
  from_rotations positioned
  step checked "$krot" model_checker --input_path "$output/positioned" \
    --output_path "$output/checked" --overwrite 1 \
    --report_path "$output/check.json"
  step adjusted "$krot" bundle_adjuster --input_path "$output/checked" \
    --output_path "$output/adjusted" --overwrite 1 \
    --BundleAdjustment.refine_focal_length 0 \
    --BundleAdjustmentCeres.loss_function_type CAUCHY \
    --BundleAdjustmentCeres.loss_function_scale \
    "$(jq '.cauchy_scale_px // 1' "$output/check.json")"
  from_rotations surveyed --rotations_path "$output/rotations.txt"
  mean_of_mapper=$(mean_mm "$mapped")
  echo "| $(basename "$scene") | $(jq .center.count "$mapped.json"
  ) | $mean_of_mapper | $(mean_mm "$output/positioned") | $(
    mean_mm "$output/adjusted") | $(mean_mm "$output/surveyed") | $(
    minutes "$output"/{features,matches}.seconds) | $(
    cat "$output/mapper.seconds") | $(cat "$output/positioned.seconds") |"
done
