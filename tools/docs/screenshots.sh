#!/usr/bin/env bash
# Makes docs/images/page_*.png: the report page of the bundled sample, at a desk
# and on a phone; its error profile; and outliers planted in it, in its photos.
# Where build-wasm/krot.html is built, browser.png, too: that page with the sample.
# Solves the sample with build/krot, or with the executable in KROT. Needs
# python3, chromium and its driver, and povray for the photos, unless
# tools/sample/render.sh has made them in PHOTOS.
#
# Usage: tools/docs/screenshots.sh [PHOTOS]
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
photos=${1:-}
if [[ -z $photos ]]; then
  "$root/tools/sample/render.sh" "$work/rendered"
  photos=$work/rendered/images
fi
"$krot" solver --input_path "$root/tools/sample/model" \
  --output_path "$work/planted" --output_type TXT --log_level 0 >/dev/null
python3 -B "$root/tests/page/plant.py" "$work/planted" 12
"$krot" outlier_filter --input_path "$work/planted" \
  --output_path "$work/clean" --html_path "$work/suspects.html" \
  --image_path "$photos" --OutlierFilter.max_error 3.3 --log_level 0 >/dev/null
export PYTHONPATH=$root/tests/page
if [[ -e $root/build-wasm/krot.html ]]; then
  python3 -B "$here/browser_screenshot.py" "$root/build-wasm/krot.html" \
    "$root/tools/sample/model" "$root/docs/images/browser.png"
fi
python3 -B "$here/screenshots.py" \
  "$work/page.html" "$work/filtered.html" "$work/suspects.html" \
  "$root/docs/images"
