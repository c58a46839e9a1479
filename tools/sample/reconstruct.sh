#!/usr/bin/env bash
# Reconstructs a folder of images with COLMAP 3.8 on the CPU: one camera of
# COLMAP's default model, one thread and fixed seeds. The features repeat
# exactly, the matches nearly: their verifier reseeds rand(), on which the
# matcher's search trees draw, at its own time. Writes WORK/database.db and the
# model WORK/0.
# Needs colmap. About two minutes for the sample's 24 views.
#
# Usage: tools/sample/reconstruct.sh IMAGES WORK
set -euo pipefail

[[ $# -eq 2 ]] || { echo "Usage: $0 IMAGES WORK" >&2; exit 1; }
images=$(cd "$1" && pwd)
mkdir -p "$2"
work=$(cd "$2" && pwd)
rm -rf "$work/database.db" "$work/0"
export QT_QPA_PLATFORM=offscreen  # COLMAP's matcher opens Qt even on the CPU.

# COLMAP drops the finest scales above 2500 features, which leaves 3000 to 4200
# an image; the model stores them all and stays under 4 MB.
colmap feature_extractor --random_seed 0 \
  --database_path "$work/database.db" --image_path "$images" \
  --ImageReader.single_camera 1 --ImageReader.camera_model SIMPLE_RADIAL \
  --SiftExtraction.use_gpu 0 --SiftExtraction.num_threads 1 \
  --SiftExtraction.max_num_features 2500
colmap exhaustive_matcher --random_seed 0 \
  --database_path "$work/database.db" \
  --SiftMatching.use_gpu 0 --SiftMatching.num_threads 1
colmap mapper --random_seed 0 \
  --database_path "$work/database.db" --image_path "$images" \
  --output_path "$work" --Mapper.num_threads 1
