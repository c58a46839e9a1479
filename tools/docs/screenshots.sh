#!/usr/bin/env bash
# Makes docs/images/page_*.png: the report page of the bundled sample, at a desk
# and on a phone, and its error profile. Solves the sample with build/krot, or with the executable in
# KROT. Needs python3, chromium and its driver.
#
# Usage: tools/docs/screenshots.sh
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)
krot=${KROT:-$root/build/krot}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$krot" solver --input_path "$root/tools/sample/model" \
  --output_path "$work/solved" --html_path "$work/page.html" \
  --log_level 0 >/dev/null
"$krot" outlier_filter --input_path "$root/tools/sample/model" \
  --output_path "$work/filtered" --html_path "$work/filtered.html" \
  --OutlierFilter.profile_path "$work/profile.json" --log_level 0 >/dev/null
PYTHONPATH=$root/tests/page python3 -B "$here/screenshots.py" \
  "$work/page.html" "$work/filtered.html" "$root/docs/images"
