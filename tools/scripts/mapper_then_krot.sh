#!/usr/bin/env bash
# COLMAP's mapper, and after it the lowest maximum with its proof, for each
# model that the mapper makes.
#
# Usage: mapper_then_krot.sh --database_path DATABASE --image_path IMAGES
#          --output_path FOLDER [OPTION OF colmap mapper]...
#
# For each model N = 0, 1, ... of the mapper, FOLDER takes
#   N                        the mapper's model
#   N_linf                   the model with the lowest maximum
#   N_linf_certificate.json  the proof (see krot certificate_checker)
#   N_linf.html              the report, to look at in a browser
#   N_overlay                both models in two colours, for colmap gui
# and the tables of krot model_comparer are printed. A FOLDER that holds a model
# already is refused. Needs colmap and krot: the one that the environment's KROT
# names, that is built here, or that is installed.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

parse_options "database_path image_path output_path" "$@"
require_options database_path image_path output_path
database=${option[database_path]}
images=${option[image_path]}
output=${option[output_path]}
[[ -f $database ]] || die "--database_path $database is not a file"
[[ -d $images ]] || die "--image_path $images is not a folder"
[[ ! -e $output/0 ]] || die "--output_path $output already holds the model 0"
require_programs colmap
find_krot
mkdir -p "$output" || die "cannot write to $output"

printf 'mapping; the log is %s/mapper.log\n' "$output" >&2
quietly "$output/mapper.log" colmap mapper --database_path "$database" \
  --image_path "$images" --output_path "$output" "${others[@]}"

num_models=0
while [[ -d $output/$num_models ]]; do
  model=$output/$num_models
  code=0
  "$krot" solver --input_path "$model" --output_path "${model}_linf" \
    --certificate_path "${model}_linf_certificate.json" \
    --html_path "${model}_linf.html" || code=$?
  ((code == 0 || code == 8)) || exit "$code"  # 8: the model as it was read
  "$krot" model_comparer --input_path1 "$model" --input_path2 "${model}_linf" \
    --certificate_path2 "${model}_linf_certificate.json" \
    --overlay_path "${model}_overlay"
  num_models=$((num_models + 1))
done
((num_models)) || die "the mapper made no model: see $output/mapper.log"
