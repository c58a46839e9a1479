#!/usr/bin/env bash
# What the finish costs where models are large: synthetic streets.
#
#   finish_growth.sh KROT OBSERVATIONS...
#
# KROT is the executable; OBSERVATIONS, about so many each, are those of a street
# as krot_benchmark scaling has it: a thousand a frame, tracks of ten, one pixel
# of noise, a start off the truth by a percent. Prints seconds of all before the
# finish and of the finish, their ratio, its iterations, RMS errors without and
# with it, and the memory announced and at the peak, in MB.
# The gap asked for is 1e-3 beyond two million observations.
set -euo pipefail

krot=$(realpath "$1")
shift
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

echo "| observations | frames | before it s | finish s | ratio | iterations | RMS lowest | RMS | announced MB | peak MB |"
echo "|---|---|---|---|---|---|---|---|---|---|"
for observations in "$@"; do
  gap=1e-4
  ((observations > 2000000)) && gap=1e-3
  "$krot" model_synthesizer --output_path "$work/street" --overwrite 1 \
    --Scene.layout street --Scene.num_frames $((observations / 1000)) \
    --Scene.num_points $((observations / 10)) --Scene.track_length 10 \
    --Scene.pixel_noise 1 --Scene.start_translation_noise 0.01 \
    --Scene.start_point_noise 0.01 --log_level 0 >/dev/null
  "$krot" solver --input_path "$work/street" --output_path "$work/solved" \
    --overwrite 1 --report_path "$work/report.json" --Solver.num_threads 2 \
    --Solver.relative_gap "$gap" >"$work/log" 2>&1
  jq -r '
    (.seconds.solve - .finish.seconds) as $before
    | [.num_observations, .num_frames, $before,
       .finish.seconds, .finish.seconds / $before, .finish.num_iterations,
       (2 * .finish.cost_initial / .num_observations | sqrt),
       .pixel_error.after.rms,
       .announced_memory_bytes / 1e6,
       .peak_memory_bytes / 1e6]
    | map(tostring) | join(" ")' "$work/report.json" | awk '{
      printf "| %d | %d | %.1f | %.1f | %.2f | %d | %.4f | %.4f | %.0f | %.0f |\n",
             $1, $2, $3, $4, $5, $6, $7, $8, $9, $10 }'
done
