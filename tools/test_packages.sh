#!/usr/bin/env bash
# Makes the Debian packages, installs them into a bare Debian 12 below FOLDER,
# and there solves the sample, builds a program of one's own against the library,
# and installs pykrot by pip. Needs root, for the bare Debian.
#
# Usage: tools/test_packages.sh FOLDER
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"
(($# == 1)) || die "usage: tools/test_packages.sh FOLDER"
((EUID == 0)) || die "a bare Debian is made as root"
bare=$1/bookworm

install_missing git:git debootstrap:debootstrap lintian:lintian
"$root/tools/make_packages.sh"
lintian --tag-display-limit 0 "$root"/build-packages/*.deb

say "A bare Debian 12 in $bare"
mkdir -p "$1"
[[ -e $bare/bin/bash ]] || debootstrap --variant=minbase bookworm "$bare" \
  http://deb.debian.org/debian >"$1/debootstrap.log"

# inside COMMAND... runs it there, in /krot.
inside() { chroot "$bare" env DEBIAN_FRONTEND=noninteractive LC_ALL=C \
  bash -euo pipefail -c "cd /krot && $*"; }

rm -rf "$bare/krot"
mkdir "$bare/krot"
git -C "$root" archive HEAD | tar -x -C "$bare/krot"
cp "$root"/build-packages/*.deb "$bare/krot"

say "krot"
inside apt-get -qq update
inside apt-get -qq install --reinstall --no-install-recommends -y ./krot_*.deb \
  bash-completion man-db ">/dev/null"
inside krot solver --input_path tools/sample/model --output_path by_command
inside "test -e /usr/share/man/man1/krot-solver.1.gz"
inside "source /usr/share/bash-completion/completions/krot; \
  COMP_WORDS=(krot solver --Solver.method ''); COMP_CWORD=3; _krot; \
  test \"\${COMPREPLY[*]}\" = 'auto res_int joint'"

say "A program of one's own"
inside apt-get -qq install --reinstall --no-install-recommends -y \
  ./libkrot-dev_*.deb \
  cmake g++ make ">/dev/null"
inside cmake -S tools/examples -B examples ">/dev/null"
inside cmake --build examples
inside examples/solve_folder tools/sample/model by_library

say "pykrot"
inside apt-get -qq install --no-install-recommends -y "${build_needs[@]#*:}" \
  pybind11-dev python3-dev python3-numpy python3-pip python3-setuptools \
  python3-wheel ">/dev/null"
inside CMAKE_ARGS=-DKROT_NATIVE=OFF pip install --quiet --break-system-packages --no-build-isolation \
  --no-deps ./src/python
inside python3 tools/examples/solve_folder.py tools/sample/model by_python

say "The same bits"
for file in images points3D; do
  cmp "$bare/krot/by_command/$file.bin" "$bare/krot/by_library/$file.bin"
  cmp "$bare/krot/by_command/$file.bin" "$bare/krot/by_python/$file.bin"
done
say "Done: command, library and pykrot agree"
