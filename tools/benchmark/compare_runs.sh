#!/usr/bin/env bash
# How two runs of run_all.sh differ, as a table: times of the later one by those
# of the earlier one, column by column.
#
# Usage: tools/benchmark/compare_runs.sh BEFORE AFTER   # two OUTPUT folders
#
# Rows are matched by model or size; the median of their ratios is printed, and
# the largest with its row. Columns in italics are of other methods, which no
# change to KROT makes faster or slower: how far they are from 1 is how far the
# machine was.
set -euo pipefail
before=${1:?"usage: compare_runs.sh BEFORE AFTER"}
after=${2:?"usage: compare_runs.sh BEFORE AFTER"}

cat <<'TABLE'
| part | column | rows | median | largest | of |
|---|---|---:|---:|---:|---|
TABLE
for report in "$after"/*.json; do
  part=$(basename "$report" .json)
  [[ -s $before/$part.json ]] || continue
  jq -nr --arg part "$part" --slurpfile before "$before/$part.json" \
    --slurpfile after "$report" '
    def own: ["KROT fast", "fast, 1e-6", "Int fast", "Res fast", "KROT auto x2",
              "KROT joint x2", "sweeps fast x1", "sweeps fast x2", "fast",
              "floor", "in all", "us per step", "krot"];
    def others: ["FDM (paper)", "Gugat", "Int paper", "Res paper",
                 "least squares x2", "colmap"];
    def name: [.method, .model, .cameras, .frames?, .track]
      | map(select(. != null) | tostring) | join(" ");
    # {row: value} of one column over all tables of times.
    def values($report; $column):
      [$report.tables[] | select(.name | test("ratio|excess|cost") | not)
       | .rows[] | select(.[$column] | type == "number" and . > 0)
       | {key: name, value: .[$column]}] | from_entries;
    def digits: . * 1000 | round / 1000;
    (own + others)[] as $column
    | values($before[0]; $column) as $old
    | [values($after[0]; $column) | to_entries[]
       | select($old[.key]) | {key, ratio: (.value / $old[.key])}]
    | select(length > 0) | sort_by(.ratio) as $rows
    | (if others | index($column) then "*\($column)*" else $column end) as $title
    | "| \($part) | \($title) | \($rows | length)"
      + " | \($rows[length / 2 | floor].ratio | digits)"
      + " | \($rows[-1].ratio | digits) | \($rows[-1].key) |"'
done
