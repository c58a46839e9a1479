#!/usr/bin/env bash
# The recorded runs of docs/history/reliability.md, on the krot in build/ that
# tools/run_tests.sh made: prints its tables of faults, kills and folders.
# Half an hour, with the defaults; those of the fuzzers are tools/run_fuzzers.sh's.
#
# Usage: tools/measure_reliability.sh [MEMORY [KILLS [ROUNDS]]]
#   MEMORY  failures of malloc of each command; 0: the 1st, 2nd, 3rd ... call,
#           as of all other kinds in any case
#   KILLS   of each command, and as many interrupts
#   ROUNDS  of folders that vanish or are shared
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

faults=$root/tests/faults
krot=$root/build/krot
status=0
run() {
  say "$*"
  python3 -B "$faults/$1" "$krot" "${@:2}" || status=1
}

run fault_test.py --library "$root"/build/tests/faults/libkrot_faults.so \
  --memory "${1:-400}"
run kill_test.py --kills "${2:-60}" --interrupts "${2:-60}"
run folder_test.py --rounds "${3:-40}" --stride 1
exit "$status"
