#!/usr/bin/env bash
# Tries build-windows/krot.exe under wine: that it makes of the sample what
# build-linux/krot does, to the bit, and what Windows has in a way of its own.
#
# Usage: tools/test_windows.sh
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"
(($# == 0)) || die "usage: tools/test_windows.sh"
linux=$root/build-linux/krot
program=$root/build-windows/krot.exe
[[ -x $linux && -e $program ]] \
  || die "tools/build_static.sh linux and windows come first"
install_missing wine wine64 python3:python3

scratch=$(mktemp -d)
export WINEPREFIX=$scratch/prefix WINEDEBUG=-all
export WINEDLLOVERRIDES="mscoree,mshtml=" LC_ALL=C.UTF-8
unset DISPLAY
trap 'wineserver -k 2>/dev/null || true; rm -rf "$scratch"' EXIT
say "A new Windows in $WINEPREFIX"
mkdir "$WINEPREFIX" "$scratch/here"
wine wineboot --init
cd "$scratch/here"
wineserver=/usr/lib/wine/wineserver64
trap '"$wineserver" -k || true; rm -rf "$scratch"' EXIT

num_tried=0
fails() { die "FAILED: $*"; }
# runs EXIT_CODE WORDS ARGUMENT... expects that code, and the words on stderr.
runs() {
  local expected=$1 words=$2 code=0
  shift 2
  wine "$program" "$@" >../out 2>../err || code=$?
  ((code == expected)) \
    || fails "krot.exe $* returned $code, not $expected: $(cat ../err)"
  [[ $(<../err) == *"$words"* ]] \
    || fails "krot.exe $* did not say '$words': $(cat ../err)"
  ((++num_tried))
}
say "The sample: the same bits as on Linux, with any kernels"
cp -r "$root/tools/sample/model" model
for kernels in own avx2 ""; do
  export KROT_KERNELS=$kernels
  "$linux" solver --input_path model --output_path "linux$kernels" \
    --certificate_path linux_proof.json >../text 2>&1
  runs 0 "" solver --input_path model --output_path "windows$kernels" \
    --certificate_path proof.json
  diff -q "linux$kernels" "windows$kernels" \
    || fails "other bits with KROT_KERNELS=$kernels"
  "$linux" certificate_checker --input_path "windows$kernels" \
    --certificate_path proof.json >../text
  runs 0 "" certificate_checker --input_path "linux$kernels" \
    --certificate_path linux_proof.json
done

say "Paths of Windows, and names in other letters"
runs 0 "" model_analyzer --input_path "Z:${scratch//\//\\}\\here\\model"
runs 0 "" solver --input_path '.\model\.' --output_path 'é ü 模型\out folder'
diff -q windows 'é ü 模型/out folder' || fails "other bits"
runs 2 "模型: no such folder" model_analyzer --input_path '模型'
deep=$(printf 'a_folder_with_a_long_name\\%.0s' {1..12})
runs 0 "" solver --input_path model --output_path "$deep"
rm -r a_folder*

say "Line ends of Windows"
runs 0 "" solver --input_path model --output_path text --output_type TXT
mkdir crlf
for file in text/*.txt; do sed 's/$/\r/' "$file" >"crlf/${file#text/}"; done
for folder in text crlf; do
  runs 0 "" solver --input_path "$folder" --output_path "$folder.out" \
    --output_type BIN
done
diff -q text.out crlf.out || fails "line ends have changed the model"

say "Adjustment, database, and a project file as Windows writes it"
printf 'input_path=windows\r\nBundleAdjustment.max_num_iterations=3\r\n' >run.ini
"$linux" bundle_adjuster --project_path run.ini --output_path linux_adjusted \
  2>../err | grep ' error ' >../text
runs 0 "" bundle_adjuster --project_path run.ini --output_path adjusted
# Ceres gives no fixed bits, but the same errors as they are printed.
diff ../text <(grep ' error ' ../out) || fails "another adjustment"
runs 0 "" model_checker --input_path adjusted --report_path report.json \
  --database_path "Z:$root/tools/sample/database.db"
grep -q '"database": {' report.json || fails "the matches were not examined"

say "The output folder is replaced as a whole"
echo mine >windows/notes.md
runs 5 "already holds a model" solver --input_path model --output_path windows
runs 0 "" point_triangulator --input_path model --output_path windows \
  --overwrite 1
[[ $(cat windows/notes.md) == mine ]] || fails "a file beside the model is lost"
left=$(find . -name '*krot-*')
[[ -z $left ]] || fails "left behind: $left"

say "What is wrong is said, with the same exit codes"
runs 1 "is no command" solve
runs 1 "add --overwrite 1" solver --input_path model --output_path MODEL
runs 5 "is a file, expected a folder" solver --input_path model \
  --output_path proof.json
ln -s . link
runs 1 "must not be --html_path" solver --input_path model --output_path never \
  --report_path new --html_path link/new
cp -r model cut && truncate -s 100 cut/images.bin
runs 2 "images.bin" solver --input_path cut --output_path never
[[ ! -e never ]] || fails "an output was begun"

say "Ctrl-C"
cat >../interrupt.py <<'END'
import signal, subprocess, sys
# A shell's background jobs ignore what Ctrl-C sends.
signal.signal(signal.SIGINT, signal.SIG_DFL)
run = subprocess.Popen(sys.argv[1:], stderr=subprocess.PIPE, text=True,
                       stdout=subprocess.DEVNULL)
print(run.stderr.readline(), end="")  # the solve has begun
signal.signal(signal.SIGINT, signal.SIG_IGN)
run.send_signal(signal.SIGINT)
print(run.stderr.read())
sys.exit(run.wait())
END
code=0
python3 ../interrupt.py wine "$program" solver --input_path model \
  --output_path windows --overwrite 1 --Solver.method res_int \
  --Solver.settings paper --log_level 2 >../out || code=$?
((code == 130)) || fails "an interrupt gave exit code $code: $(<../out)"
grep "interrupted" ../out
[[ $(<windows/notes.md) == mine ]] || fails "a file beside the model is lost"

say "Done: krot.exe was run $num_tried times"
