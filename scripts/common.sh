# Sourced by the scripts beside it: where the project is, how to install what it needs, how to build.

project=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# The system's Python, not one that shadows it: catkin's modules belong to that one.
export PATH="/usr/bin:$PATH"
export PYTHONPATH=
# Lets ccache know a file again at another place, as in the tests that build a copy.
export CCACHE_BASEDIR="$project" CCACHE_NOHASHDIR=1

say() { printf '\n== %s\n' "$*"; }

# Installs the packages of dependencies.txt that are missing; silent if there are none.
install_dependencies() {
  local packages missing=() sudo=()
  packages=$(sed 's/#.*//' "$project/scripts/dependencies.txt" | awk '{for (i = 2; i <= NF; ++i) print $i}')
  for package in $packages; do
    [ "$(dpkg-query -W -f '${Status}' "$package" 2>/dev/null)" = "install ok installed" ] ||
      missing+=("$package")
  done
  [ ${#missing[@]} -eq 0 ] && return
  say "installing ${#missing[@]} packages: ${missing[*]}"
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || { echo "run this as root, or install sudo" >&2; exit 1; }
    sudo=(sudo)
  fi
  "${sudo[@]}" apt-get update -q
  "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${missing[@]}"
}

# build TARGET...: configures and builds in build/.
build() {
  say "configuring (log: build/configure.log)"
  mkdir -p "$project/build"
  cmake -S "$project" -B "$project/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DUSCT_BENCHMARKS=ON \
    -DUSCT_UNITS="$project/build/units" \
    > "$project/build/configure.log" 2>&1 || { cat "$project/build/configure.log"; exit 1; }
  say "building: $*"
  cmake --build "$project/build" --target "$@"
}
