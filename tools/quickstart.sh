#!/usr/bin/env bash
# From a fresh Debian 12 to a solved model: installs what the build needs if it
# is missing (with sudo if not root), builds krot into build/, and solves the
# bundled sample. Needs no COLMAP. May be run again, from any folder.
#
# Usage: tools/quickstart.sh
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

input=$root/tools/sample/model
output=$root/build/sample_linf

install_missing "${build_needs[@]}"
build_krot "$root/build" -DKROT_BUILD_TESTS=OFF

say "Solving $input"
"$root/build/krot" solver --input_path "$input" --output_path "$output" \
  --overwrite 1

say "Done: the new model is in $output"
cat <<END
Next:
  look at it            colmap gui --import_path $output
  see where errors are  $root/build/krot model_analyzer --path $output
  solve your own model  $root/build/krot solver --input_path MODEL --output_path RESULT
END
