#!/usr/bin/env bash
# Builds and installs the package in each way that README promises, then a package that uses it.
#   build_variants.sh PROJECT BUILD_FOLDER cmake|core_only|catkin_make|catkin_build
# `cmake` installs what BUILD_FOLDER holds; the others build from a copy in a temporary folder.
set -euo pipefail
project=$1 build=$2 variant=$3
source "$(dirname "$0")/sources.sh"
# Not below the project, where rospack would find a second package of its name.
work=${TMPDIR:-/tmp}/us_ct_registration_package_test_$UID
rm -rf "$work"
mkdir -m 700 "$work"
trap 'rm -rf "$work"' EXIT
source_dir=$work/ws/src/us_ct_registration

copy_sources() {  # copy_sources DEVEL: as a user's checkout, whose messages are generated in DEVEL
  mkdir -p "$source_dir/build"
  (cd "$project" && list_sources "$project" | xargs -0 cp --parents -t "$source_dir")
  # The same files, compiled in the same way as in BUILD_FOLDER: with ccache they need not be compiled again.
  export CCACHE_BASEDIR=$source_dir CCACHE_NOHASHDIR=1 USCT_DEVEL=$1
  ln -s "$USCT_DEVEL" "$source_dir/build/devel"
  as_project=(-DCMAKE_BUILD_TYPE=Release "-DUSCT_UNITS=$(units_of "$build" "$source_dir")"
    "-DCMAKE_CXX_COMPILER_LAUNCHER=$project/test/package/compile_as_project.sh")
}

use_from() {  # use_from PREFIX: builds and runs the downstream package against it
  cmake -S "$project/test/package/downstream" -B "$work/downstream" -G Ninja -DCMAKE_PREFIX_PATH="$1"
  cmake --build "$work/downstream"
  LD_LIBRARY_PATH="$1/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}" "$work/downstream/downstream"
  "$1/bin/usct" --help > /dev/null
  # A module (src/core/module.h) is found wherever the library is.
  printf '%s\n' '#Insight Transform File V1.0' '#Transform 0' 'Transform: Euler3DTransform_double_3_3' \
    'Parameters: 0 0 0 1 2 3' 'FixedParameters: 0 0 0' > "$work/moved.tfm"
  "$1/bin/usct" info "$work/moved.tfm" > /dev/null
  "$(find "$1/lib" "$1/share" -name study_report -perm /u+x)" --help > /dev/null
  if [[ $variant == core_only ]]; then
    ! "$1/bin/usct" bag --help 2> "$work/refusal"
    grep 'built without ROS' "$work/refusal"
  else
    "$1/bin/usct" bag --help > /dev/null
  fi
}

case $variant in
  cmake)
    cmake --install "$build" --prefix "$work/prefix"
    use_from "$work/prefix" ;;
  core_only)
    copy_sources "$work/no_messages"
    cmake -S "$source_dir" -B "$source_dir/build" -G Ninja "${as_project[@]}" -DUSCT_CORE_ONLY=ON \
      -DCMAKE_INSTALL_PREFIX="$work/prefix" -DCMAKE_INSTALL_LIBDIR=lib
    cmake --build "$source_dir/build" --target all test_geometry test_volume
    ctest --test-dir "$source_dir/build" --output-on-failure --no-tests=error -R '^test_(geometry|volume)$'
    cmake --build "$source_dir/build" --target install
    use_from "$work/prefix" ;;
  # catkin_make by itself stops at a load of as many as there are cores, which a busy machine always has.
  catkin_make)
    copy_sources "$work/ws/devel"
    (cd "$work/ws" && catkin_make --use-ninja -j"$(nproc)" -l99 "${as_project[@]}" -DCATKIN_ENABLE_TESTING=OFF install)
    use_from "$work/ws/install" ;;
  catkin_build)
    copy_sources "$work/ws/devel/.private/us_ct_registration"
    # Both packages in one workspace: the second finds the first as a catkin component.
    cp -r "$project/test/package/downstream" "$work/ws/src/"
    (cd "$work/ws" && catkin config --init --install \
      --cmake-args "${as_project[@]}" -DCATKIN_ENABLE_TESTING=OFF &&
      catkin build --no-status && set +u && . install/setup.sh && downstream)
    use_from "$work/ws/install" ;;
  *) echo "unknown variant '$variant'" >&2; exit 2 ;;
esac
