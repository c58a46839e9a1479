#!/usr/bin/env bash
# Builds krot as one file that needs nothing beside it: for any 64-bit Linux on
# x86, build-linux/krot, or for Windows by mingw-w64, build-windows/krot.exe.
# The libraries that Debian has no static form of are built from Debian's
# sources, Ceres without SuiteSparse, which has GPL parts, and without CUDA, which
# has no static form. With -DKROT_MINIMAL=ON there are no bundle adjustment, no
# databases, photos and project files, and Ceres is not built.
#
# Usage: tools/build_static.sh linux|windows [CMAKE_OPTION...]
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"
[[ ${1:-} == linux || ${1:-} == windows ]] \
  || die "usage: tools/build_static.sh linux|windows [CMAKE_OPTION...]"
system=$1
shift
is_minimal=
[[ " $* " != *" -DKROT_MINIMAL=ON "* ]] || is_minimal=1
folder=$root/build-$system
needs=$folder/needs  # what is built of them
sources=$root/build-sources

# get_source PACKAGE [FOLDER...] unpacks the package's source, or these folders of
# it, below $sources/PACKAGE.
get_source() {
  local package=$1
  shift
  [[ ! -e $sources/$package ]] || return 0
  say "The source of $package"
  local lists=$sources/lists apt
  mkdir -p "$lists/partial" "$sources/$package.new"
  echo "deb-src http://deb.debian.org/debian bookworm main" >"$sources/list"
  apt=(apt-get -qq -o "Dir::Etc::SourceList=$sources/list"
    -o Dir::Etc::SourceParts=/dev/null -o "Dir::State::Lists=$lists"
    -o APT::Sandbox::User=root)
  "${apt[@]}" update
  (cd "$sources" \
    && "${apt[@]}" source --only-source --download-only "$package")
  tar -x -f "$sources/$package"_*.orig.tar.* -C "$sources/$package.new" \
    --strip-components=1 --wildcards "${@/#/*/}"
  mv "$sources/$package.new" "$sources/$package"
}

# build_need PACKAGE CMAKE_OPTION... builds a library by its own CMakeLists.txt.
build_need() {
  local package=$1
  shift
  [[ ! -e $needs/$package.done ]] || return 0
  say "Building $package for $system"
  cmake -S "$sources/$package" -B "$needs/$package" -G Ninja \
    -DCMAKE_BUILD_TYPE=Release "-DCMAKE_INSTALL_PREFIX=$needs" \
    "-DCMAKE_PREFIX_PATH=$needs" "${toolchain[@]}" "$@" >/dev/null
  cmake --build "$needs/$package" --target install >/dev/null
  touch "$needs/$package.done"
}

# compile_need NAME COMPILER SOURCE... makes lib/libNAME.a.
compile_need() {
  local name=$1 compiler=$2 source objects=$needs/$1
  shift 2
  [[ ! -e $needs/lib/lib$name.a ]] || return 0
  say "Building $name for $system"
  mkdir -p "$objects" "$needs/lib"
  for source in "$@"; do
    "$compiler" -O2 -w -DBOOST_BIND_GLOBAL_PLACEHOLDERS -c \
      "-I$needs/include" "$source" \
      -o "$objects/$(basename "$source").o"
  done
  "$archiver" rcs "$needs/lib/lib$name.a" "$objects"/*.o
}

mkdir -p "$needs/include" "$sources"
toolchain=()
# Whole unless asked otherwise, whatever an earlier build there was.
options=("-DCeres_DIR=$needs/lib/cmake/Ceres" -DKROT_MINIMAL=OFF)
if [[ $system == windows ]]; then
  toolchain=("-DCMAKE_TOOLCHAIN_FILE=$root/cmake/Windows.cmake"
    "-DCMAKE_FIND_ROOT_PATH=$needs"
    -DEigen3_DIR=/usr/share/eigen3/cmake)
  options+=("${toolchain[@]}" -DBoost_NO_BOOST_CMAKE=ON
    -DZLIB_LIBRARY=/usr/x86_64-w64-mingw32/lib/libz.a)
  install_missing "${build_needs[@]}" xz:xz-utils make:make tclsh:tcl \
    libz-mingw-w64-dev x86_64-w64-mingw32-g++-posix:g++-mingw-w64-x86-64-posix
else
  install_missing "${build_needs[@]}" xz:xz-utils
fi
if [[ $system == windows && -z $is_minimal ]]; then
  archiver=x86_64-w64-mingw32-ar
  for headers in boost eigen3/Eigen eigen3/unsupported nlohmann; do
    ln -sfn "/usr/include/$headers" "$needs/include/$(basename "$headers")"
  done
  get_source sqlite3
  if [[ ! -e $needs/include/sqlite3.h ]]; then
    (cd "$sources/sqlite3" && ./configure >/dev/null \
      && make -s sqlite3.c >/dev/null)
    cp "$sources"/sqlite3/sqlite3.h "$needs/include"
  fi
  compile_need sqlite3 x86_64-w64-mingw32-gcc-posix "$sources/sqlite3/sqlite3.c"
  get_source boost1.74 libs/program_options
  compile_need boost_program_options x86_64-w64-mingw32-g++-posix \
    "$sources"/boost1.74/libs/program_options/src/*.cpp
  get_source libjpeg-turbo
  build_need libjpeg-turbo -DENABLE_SHARED=OFF -DWITH_SIMD=OFF \
    -DWITH_TURBOJPEG=OFF
  get_source libpng1.6
  build_need libpng1.6 -DPNG_SHARED=OFF -DPNG_TESTS=OFF
fi
if [[ -z $is_minimal ]]; then
  get_source ceres-solver
  # Without glog it logs by itself: nothing but what ends the process.
  build_need ceres-solver -DMINIGLOG=ON -DGFLAGS=OFF -DCUDA=OFF \
    -DSUITESPARSE=OFF -DCXSPARSE=OFF -DLAPACK=OFF -DEIGENSPARSE=ON \
    -DSCHUR_SPECIALIZATIONS=OFF -DBUILD_TESTING=OFF -DBUILD_EXAMPLES=OFF \
    -DBUILD_BENCHMARKS=OFF -DCMAKE_CXX_FLAGS=-DMAX_LOG_LEVEL=-3
fi

target=krot build_krot "$folder" -DKROT_STATIC=ON -DKROT_NATIVE=OFF \
  -DKROT_BUILD_TESTS=OFF "${options[@]}" "$@"
