#!/usr/bin/env bash
# Shows that two builds of krot do the same: runs both on every model of a
# folder, through every command that computes, and compares models, reports and
# certificates byte by byte. Only times and memory may differ. For changes that
# are meant to change nothing.
#
# Usage: tools/benchmark/same_outputs.sh KROT_BEFORE KROT_AFTER MODELS [NAME...]
set -euo pipefail

if (($# < 3)); then
  sed -n '2,/^$/s/^# \{0,1\}//p' "${BASH_SOURCE[0]}" >&2
  exit 1
fi
before=$(realpath "$1")
after=$(realpath "$2")
models=$(realpath "$3")
shift 3
(($#)) || mapfile -t names < <(ls "$models")
(($#)) && names=("$@")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# What a run prints and reports, but for times, memory and this folder's name.
without_times() {
  sed -E -e "s#$work/(before|after)#WORK#g" -e '/^Read .* s in all/d' \
    -e '/seconds|peak_memory_bytes/d' \
    -e '/"(read|build|solve|certify|write|start|adjust|removal|total)": [0-9.e+-]+,?$/d'
}

# run KROT SIDE LABEL ARGUMENT... leaves output, code and files in $work/SIDE/.
run() {
  local krot=$1 out=$work/$2/$3
  shift 3
  mkdir -p "$out"
  local code=0
  (cd "$out" && "$krot" "$@" >stdout.raw 2>stderr.raw </dev/null) || code=$?
  echo "$code" >"$out/code"
  without_times <"$out/stdout.raw" >"$out/stdout"
  grep -E '^krot|error|warning' "$out/stderr.raw" | without_times \
    >"$out/stderr" || true
  rm "$out"/*.raw
  if [[ -f $out/report.json ]]; then
    without_times <"$out/report.json" >"$out/report" && rm "$out/report.json"
  fi
}

# all_commands KROT SIDE MODEL runs what there is to compare.
all_commands() {
  local krot=$1 side=$2 model=$3
  local solved=(--input_path "$model" --output_path out
    --report_path report.json)
  run "$krot" "$side" auto solver "${solved[@]}" \
    --certificate_path certificate.json
  run "$krot" "$side" joint solver "${solved[@]}" --Solver.method joint
  run "$krot" "$side" res_int solver "${solved[@]}" --Solver.method res_int \
    --ResInt.max_sweeps 5
  run "$krot" "$side" paper solver "${solved[@]}" --Solver.settings paper \
    --ResInt.max_sweeps 1
  run "$krot" "$side" feasible solver "${solved[@]}" --Solver.init feasible
  run "$krot" "$side" points point_triangulator "${solved[@]}"
  run "$krot" "$side" adjusted bundle_adjuster "${solved[@]}" \
    --BundleAdjustmentCeres.num_threads 1
  run "$krot" "$side" analysed model_analyzer --path "$model" \
    --report_path report.json
  local own=$work/$side/auto
  [[ -d $own/out ]] || return 0
  run "$krot" "$side" compared model_comparer --input_path1 "$model" \
    --input_path2 "$own/out" --report_path report.json
  [[ -f $own/certificate.json ]] || return 0
  run "$krot" "$side" checked certificate_checker --input_path "$own/out" \
    --certificate_path "$own/certificate.json"
}

num_different=0
for name in "${names[@]}"; do
  [[ -d $models/$name ]] || continue
  rm -rf "$work"/{before,after}
  all_commands "$before" before "$models/$name" &
  all_commands "$after" after "$models/$name"
  wait $!
  if difference=$(diff -rq "$work/before" "$work/after"); then
    files=$(find "$work/after" -type f | wc -l)
    echo "same       $name ($files files)"
  else
    num_different=$((num_different + 1))
    echo "different  $name"
    sed -e "s#$work/##g" -e 's/^/           /' <<<"$difference"
    [[ -z ${KEEP:-} ]] || { rm -rf "${KEEP:?}/$name" && mkdir -p "$KEEP/$name" && cp -r "$work"/{before,after} "$KEEP/$name"; }
  fi
done
if ((num_different)); then
  echo "$num_different models come out differently"
  exit 1
fi
echo "all the same"
