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
  cmake -S "$project" -B "$project/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DUSCT_BENCHMARKS=ON -DUSCT_CORE_ONLY=OFF \
    -DUSCT_UNITS="$project/build/units" \
    > "$project/build/configure.log" 2>&1 || { cat "$project/build/configure.log"; exit 1; }
  say "building: $*"
  cmake --build "$project/build" --target "$@"
}

# Everything that was started ends with the script, however that ends, and the folder `temporary` is removed.
started=() temporary=''
start() {  # start LOG COMMAND...
  local log=$1; shift
  setsid "$@" > "$log" 2>&1 &
  started+=($!)
}
stop_all() {
  local status=$? i pid
  trap - EXIT INT TERM
  # Last started first; roslaunch ends its nodes before itself.
  for ((i = ${#started[@]} - 1; i >= 0; --i)); do
    pid=${started[i]}
    kill -TERM "$pid" 2>/dev/null || continue
    for _ in $(seq 400); do kill -0 "$pid" 2>/dev/null || break; sleep 0.1; done
    kill -KILL -- "-$pid" 2>/dev/null || true
  done
  rm -rf ${temporary:+"$temporary"}
  exit "$status"
}

# own_master FOLDER: a ROS master of the script's own, started by start_master, with its logs in FOLDER. Whatever else
# runs on this machine is left alone, and what the script starts ends with it.
own_master() {
  trap stop_all EXIT
  trap 'exit 130' INT
  trap 'exit 143' TERM
  master_port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("localhost", 0)); print(s.getsockname()[1])')
  export ROS_MASTER_URI=http://localhost:$master_port ROS_HOSTNAME=localhost ROS_LOG_DIR=$1/log ROS_HOME=$1/ros
  unset ROS_IP
}
start_master() {
  mkdir -p "$ROS_LOG_DIR"
  start "$ROS_LOG_DIR/master.log" roscore -p "$master_port"
  until rosparam list > /dev/null 2>&1; do kill -0 "${started[-1]}"; sleep 0.2; done
}
client() { python3 "$project/scripts/demo_client.py" "$@"; }

# start_rviz: with this package's configuration, on the user's screen or, without one, on a virtual one of 1400 x 900
# pixels. `screen` is its name and `rviz_pid` the process; both stay empty if there is no screen.
screen='' rviz_pid=''
start_rviz() {
  local software=() name=$ROS_LOG_DIR/display
  screen=${DISPLAY:-}
  if [ -z "$screen" ]; then
    start "$ROS_LOG_DIR/xvfb.log" Xvfb -displayfd 3 -screen 0 1400x900x24 3> "$name"
    for _ in $(seq 100); do [ ! -s "$name" ] || break; sleep 0.1; done
    [ -s "$name" ] || { echo "Xvfb does not start; no pictures of rviz" >&2; return; }
    screen=:$(< "$name")
    software=(LIBGL_ALWAYS_SOFTWARE=1)
  fi
  start "$ROS_LOG_DIR/rviz.log" env DISPLAY="$screen" QT_X11_NO_MITSHM=1 "${software[@]}" \
    rviz -d "$project/rviz/registration.rviz"
  rviz_pid=${started[-1]}
}
# take_picture FILE: of the screen, once rviz has drawn what it got.
take_picture() {
  [ -n "$screen" ] || return 0
  sleep 5
  DISPLAY=$screen import -window root "$1"
}
