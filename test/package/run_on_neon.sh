#!/usr/bin/env bash
# Builds the tests of the similarities for ARM, and runs them in an emulator: kernels on NEON against their
# references. By hand: run_on_neon.sh [FOLDER]; needs the packages g++-aarch64-linux-gnu and qemu-user.
set -euo pipefail
project=$(cd "$(dirname "$0")/../.." && pwd)
work=${1:-${TMPDIR:-/tmp}/us_ct_registration_neon_$UID}
cross=aarch64-linux-gnu
for program in $cross-g++ qemu-aarch64; do
  command -v $program > /dev/null || { echo "$program is missing: apt-get install g++-$cross qemu-user" >&2; exit 1; }
done
mkdir -p "$work"/{objects,root,apt/lists/partial,apt/archives/partial}

# ARM's libraries, beside the system and not into it.
apt=(apt-get -qq -o APT::Architecture=arm64 -o APT::Architectures=arm64
     -o Dir::State="$work/apt" -o Dir::State::status=/dev/null -o Dir::Cache="$work/apt")
(cd "$work/apt" && "${apt[@]}" update && "${apt[@]}" download libhwy1 libhwy-dev libgtest-dev librapidcheck-dev libtbb12 libtbb-dev)
for package in "$work"/apt/*.deb; do dpkg -x "$package" "$work/root"; done
mkdir -p "$work/headers"
ln -sfn /usr/include/boost "$work/headers/boost"  # only headers of the system that hold for any processor

export work cross
compile() {
  $cross-g++ -std=c++17 -O2 -pthread -Iinclude -Isrc/core -Itest -I/usr/include/eigen3 -I"$work/root/usr/include" \
    -idirafter "$work/headers" -c "$1" -o "$work/objects/$(tr / _ <<< "$1").o"
}
export -f compile
cd "$project"
ls src/core/{parallel,text}.cpp src/core/{geometry,volume,ultrasound,simulation,similarity}/*.cpp test/core/similarity/*.cpp \
  test/core/ultrasound/test_gaussian_sums.cpp test/core/volume/test_{operations,combine_rows}.cpp |
  xargs -P"$(nproc)" -I{} bash -c 'compile {}'
libraries=$work/root/usr/lib/$cross
$cross-g++ -pthread "$work"/objects/*.o -o "$work/tests" -L"$libraries" -lgtest_main -lgtest -lrapidcheck -lhwy -ltbb
QEMU_LD_PREFIX=/usr/$cross qemu-aarch64 -E LD_LIBRARY_PATH="$libraries" "$work/tests"
