#!/usr/bin/env bash
# Makes docs/images/gui_*.png: COLMAP's GUI with the bundled sample, points
# coloured by error before and after `krot solver`, and both models on top of
# each other. Solves the sample with build/krot, or with the executable in KROT.
# Needs colmap, xvfb-run, xdotool and ImageMagick (import, mogrify); run it on an
# idle machine, as it waits for the GUI by the clock.
#
# With an executable of COLMAP 3.8 patched by third_party_patches/, makes
# gui_patched.png alone: the dialogue, and the log of its run.
#
# Usage: tools/docs/gui_screenshots.sh [PATCHED_COLMAP]
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)

# The display is this script's own: it starts itself again inside of it.
if [[ -z ${KROT_GUI_SCREENSHOTS:-} ]]; then
  export KROT_GUI_SCREENSHOTS=1
  exec xvfb-run -a -s "-screen 0 900x640x24" "$0" "$@"
fi
unset QT_QPA_PLATFORM
krot=${KROT:-$root/build/krot}
sample=$root/tools/sample/model
images=$root/docs/images
work=$(mktemp -d)
gui=
trap '[[ -z $gui ]] || kill "$gui" 2>/dev/null; rm -rf "$work"' EXIT

# wheel BUTTON COUNT [KEY] turns the wheel over the scene; button 4 is forwards,
# 5 backwards.
wheel() {
  local button=$1 count=$2 key=${3:-}
  [[ -z $key ]] || xdotool keydown "$key"
  xdotool click --repeat "$count" --delay 150 "$button"
  [[ -z $key ]] || xdotool keyup "$key"
}

# drag BUTTON STEPS X Y drags the scene by STEPS times (X, Y) pixels.
drag() {
  local button=$1 steps=$2 step
  xdotool mousemove 450 340 mousedown "$button"
  for ((step = 0; step < steps; ++step)); do
    xdotool mousemove_relative -- "$3" "$4" sleep 0.05
  done
  xdotool mouseup "$button"
  sleep 1
}

click() { xdotool mousemove "$1" "$2" click 1 sleep 1; }

# open MODEL SIZE shows it in a window as large as the display, seen from above,
# with points that many steps larger than the GUI's.
open() {
  local window
  colmap gui --database_path "$work/database.db" --image_path "$work" \
    --import_path "$1" >"$work/log" 2>&1 &
  gui=$!
  window=$(xdotool search --sync --onlyvisible --name '^COLMAP$' | head -n 1)
  sleep 5
  xdotool windowsize --sync "$window" 900 640
  sleep 2
  click 892 64  # closes the log
  xdotool mousemove 450 340
  wheel 4 11
  wheel 4 "$2" ctrl
  wheel 5 5 alt   # smaller cameras
  drag 3 10 16 5
}

# Render > Render options: all points, whatever their error and track.
show_all_points() {
  click 266 11
  xdotool key Up Return sleep 1
  xdotool mousemove 280 193 click --repeat 2 1 key ctrl+a type 100
  xdotool mousemove 280 222 click --repeat 2 1 key ctrl+a type 2
  sleep 1
}

# The dialog's "Point colormap" becomes "Error".
choose_error_colors() {
  click 286 269
  xdotool key Down Return sleep 1
}

# apply Y presses the button; its place depends on what the dialog shows.
apply() { click 286 "$1"; }

close_dialog() {
  local dialog
  dialog=$(xdotool search --onlyvisible --name 'Render options')
  xdotool windowunmap "$dialog" sleep 2
}

shoot() {
  import -window root "$images/$1"
  # Flat colours: a palette holds them.
  mogrify -strip -colors 128 "PNG8:$images/$1"
}

close() {
  kill "$gui"
  wait "$gui" 2>/dev/null || true
  gui=
}

# shoot_model MODEL SIZE PICTURE
shoot_model() {
  open "$1" "$2"
  show_all_points
  apply 526
  close_dialog
  shoot "$3"
  close
}

# shoot_dialogue COLMAP PICTURE: imports the sample by the menu, as COLMAP enables
# what changes a model only then.
shoot_dialogue() {
  local window dialogue
  cp -r "$sample" "$work/model"
  "$1" gui --database_path "$work/database.db" --image_path "$work" \
    >"$work/log" 2>&1 &
  gui=$!
  window=$(xdotool search --sync --onlyvisible --name '^COLMAP$' | head -n 1)
  sleep 5
  xdotool windowsize --sync "$window" 900 640
  sleep 2
  click 20 11    # File
  click 77 162   # Import model
  sleep 2
  xdotool type "$work/model"
  xdotool key Return sleep 2
  xdotool key alt+n sleep 3  # no project.ini: only the model
  click 195 11   # Reconstruction
  click 228 240  # Lower the largest error
  sleep 2
  dialogue=$(xdotool search --onlyvisible --name 'Lower the largest error')
  xdotool windowmove --sync "$dialogue" 20 340
  xdotool mousemove 293 592 click 1 sleep 5  # Run
  xdotool windowsize --sync "$window" 900 639  # draws it anew
  sleep 2
  shoot "$2"
  close
}

if (($# == 1)); then
  shoot_dialogue "$1" gui_patched.png
  exit
fi
"$krot" solver --input_path "$sample" --output_path "$work/linf" \
  --log_level 0 >/dev/null
"$krot" model_comparer --input_path1 "$sample" --input_path2 "$work/linf" \
  --overlay_path "$work/overlay" --log_level 0 >/dev/null
"$krot" model_analyzer --path "$sample" --error_colors_path "$work/before" \
  >/dev/null
"$krot" model_analyzer --path "$work/linf" --error_colors_path "$work/after" \
  >/dev/null

open "$sample" 14
show_all_points
choose_error_colors
apply 613
sleep 2
shoot gui_render_options.png
close
shoot_model "$work/before" 14 gui_errors_before.png
shoot_model "$work/after" 14 gui_errors_after.png
shoot_model "$work/overlay" 6 gui_overlay.png
