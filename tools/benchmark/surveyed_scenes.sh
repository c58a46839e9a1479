#!/usr/bin/env bash
# Camera centres from photos against a survey: the textbook experiment on the
# scenes of Strecha et al. (CVPR 2008), K given.
#
# Usage: surveyed_scenes.sh --input_path SCENES --output_path FOLDER
#   --max_num_features N  SIFT features of a photo; 3000 if not given
#
# SCENES is the folder Benchmarking_Camera_Calibration_2008 of
# https://github.com/openMVG/SfM_quality_evaluation, which you fetch; a scene is
# a folder with images/*.jpg, images/K.txt and gt_dense_cameras/*.camera.
# FOLDER takes a folder of results for each; what is there is not made again.
#
# Prints the mean distance of the centres from the survey after the similarity
# that fits best, mm: of COLMAP's mapper; of KROT's positions from nothing with
# the mapper's rotations, and these after the noise filter and an adjustment;
# of KROT's positions with the surveyed rotations. Needs colmap, jq and krot.
# On two cores, fifteen minutes a scene of ten photos.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../scripts/common.sh"

parse_options "input_path output_path max_num_features" "$@"
((${#others[@]} == 0)) || die "${others[0]} is unknown; -h shows the usage"
require_options input_path output_path
require_programs colmap jq
find_krot

# mean_mm TRUTH MODEL prints the mean distance, or nothing without a model.
mean_mm() {
  [[ -e $2/images.bin ]] || return 0
  quietly "$2.compared.log" "$krot" model_comparer --input_path1 "$1" \
    --input_path2 "$2" --alignment similarity --report_path "$2.json"
  jq -r '.center.mean * 100000 | round / 100' "$2.json"
}

# make FOLDER/NAME COMMAND... makes a model, unless it is there.
make() {
  local output=$1
  shift
  [[ -e $output/images.bin ]] ||
    quietly "$output.log" "$@" --output_path "$output"
}

reconstruct() {
  local scene=$1 output=$2 K
  read -r -a K <<<"$(tr -c '0-9.eE+-' ' ' <"$scene/images/K.txt" | tr -s ' ')"
  quietly "$output/features.log" colmap feature_extractor \
    --database_path "$output/database.db" --image_path "$scene/images" \
    --ImageReader.single_camera 1 --ImageReader.camera_model PINHOLE \
    --ImageReader.camera_params "${K[0]},${K[4]},${K[2]},${K[5]}" \
    --SiftExtraction.use_gpu 0 \
    --SiftExtraction.max_num_features "${option[max_num_features]:-3000}"
  quietly "$output/matches.log" colmap exhaustive_matcher \
    --database_path "$output/database.db" --SiftMatching.use_gpu 0
  mkdir -p "$output/sparse"
  quietly "$output/mapper.log" colmap mapper \
    --database_path "$output/database.db" --image_path "$scene/images" \
    --output_path "$output/sparse" --Mapper.ba_refine_focal_length 0 \
    --Mapper.ba_refine_principal_point 0 --Mapper.ba_refine_extra_params 0 \
    --Mapper.multiple_models 0
}

echo "| scene | images | COLMAP's mapper | from its rotations | filtered, adjusted | from surveyed rotations |"
echo "|---|---|---|---|---|---|"
for scene in "${option[input_path]}"/*/; do
  scene=${scene%/}
  [[ -d $scene/gt_dense_cameras && -r $scene/images/K.txt ]] || continue
  output=${option[output_path]}/$(basename "$scene")
  mkdir -p "$output"
  printf 'reconstructing %s\n' "$scene" >&2
  [[ -e $output/sparse/0/images.bin ]] || {
    rm -f "$output/database.db"
    reconstruct "$scene" "$output"
  }
  mapped=$output/sparse/0
  truth=$output/truth
  [[ -e $truth/images.txt ]] ||
    quietly "$output/truth.log" \
      "$(dirname "${BASH_SOURCE[0]}")/../scripts/strecha_to_colmap.sh" \
      --input_path "$scene/gt_dense_cameras" --output_path "$truth"
  awk '!/^#/ && NF == 10 { print $10, $2, $3, $4, $5 }' "$truth/images.txt" \
    >"$output/rotations.txt"
  make "$output/positioned" "$krot" solver --input_path "$mapped" \
    --Solver.init feasible --Solver.max_error 8 --Solver.finish_loss cauchy
  make "$output/filtered" "$krot" model_checker \
    --input_path "$output/positioned"
  make "$output/adjusted" "$krot" bundle_adjuster \
    --input_path "$output/filtered" --BundleAdjustment.refine_focal_length 0 \
    --BundleAdjustmentCeres.loss_function_type CAUCHY
  make "$output/surveyed" "$krot" solver --input_path "$mapped" \
    --rotations_path "$output/rotations.txt" \
    --Solver.init feasible --Solver.max_error 8 --Solver.finish_loss cauchy
  echo "| $(basename "$scene") | $(grep -c . "$output/rotations.txt") | $(
    mean_mm "$truth" "$mapped") | $(mean_mm "$truth" "$output/positioned") | $(
    mean_mm "$truth" "$output/adjusted") | $(
    mean_mm "$truth" "$output/surveyed") |"
done
