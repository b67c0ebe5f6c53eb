#!/usr/bin/env bash
# Builds the Debian packages, installs them and uses what they install, as somebody would who has only the packages.
#   debian_packages.sh PROJECT [BUILD_FOLDER [OUTPUT]]
# With BUILD_FOLDER the compiler gets the flags of the project's own build there, so that ccache need not compile
# again; without it, those of dpkg-buildflags. OUTPUT: folder that gets the packages.
#
# They are installed in a copy of this machine (an overlay, of which the machine sees nothing), so that dpkg checks the
# dependencies against what is installed here. With USCT_CLEAN_ROOT=1 it is a bare Debian made by mmdebstrap, where apt
# installs them with what they depend on, and nothing else.
# Needs root, debhelper, dh-python and help2man. Runs lintian if it is installed.
set -euo pipefail
project=$1 build=${2-} output=${3-}
source "$(dirname "$0")/sources.sh"
for tool in dh dh_python3 help2man; do
  command -v "$tool" > /dev/null || { echo "skipped: $tool is not installed"; exit 0; }
done
unshare --mount true 2> /dev/null || { echo "skipped: file systems cannot be mounted here"; exit 0; }
work=${TMPDIR:-/tmp}/us_ct_registration_debian_test_$UID
rm -rf "$work"
mkdir -m 700 "$work"
trap 'rm -rf "$work"' EXIT
source_dir=$work/us-ct-registration

build_packages() {
  mkdir -p "$source_dir/build"
  (list_sources "$project" | (cd "$project" && xargs -0 cp --parents -t "$source_dir"))
  if [ -n "$build" ]; then
    export CCACHE_BASEDIR=$source_dir CCACHE_NOHASHDIR=1
    export USCT_DEVEL=$source_dir/obj-$(dpkg-architecture -qDEB_HOST_MULTIARCH)/devel
    ln -s "$USCT_DEVEL" "$source_dir/build/devel"
    export DEB_CFLAGS_SET= DEB_CXXFLAGS_SET= DEB_CPPFLAGS_SET=
    # debhelper sets LC_ALL, by which ccache would tell the objects apart.
    local launcher="env;-u;LC_ALL;$project/test/package/compile_as_project.sh"
    local units; units=$(units_of "$build" "$source_dir")
    export USCT_CMAKE_OPTIONS="-DUSCT_WERROR=ON '-DUSCT_UNITS=$units' '-DCMAKE_CXX_COMPILER_LAUNCHER=$launcher'"
  fi
  # debhelper looks for the archive's ROS below /usr, not in a workspace that was sourced here.
  (cd "$source_dir" && env -u CMAKE_PREFIX_PATH -u ROS_PACKAGE_PATH dpkg-buildpackage -b -us -uc)
  if command -v lintian > /dev/null; then
    lintian --fail-on error "$work"/*.changes
  fi
}

# Everything below runs where the packages are installed, with an environment of its own.
use_packages() {
  cat << 'SCRIPT'
set -euo pipefail
cd /tmp/packages
export HOME=/tmp/packages ROS_HOSTNAME=localhost ROS_MASTER_URI=http://localhost:11877
usct --version
usct presets > presets && grep -q patient presets
usct phantom --scene agar --size 32 24 11 --quiet --output case
usct bag write --us case/us.nrrd --output sweep.bag
usct bag info sweep.bag
man --where usct > /dev/null 2>&1 || test -e /usr/share/man/man1/usct.1.gz
cmake -S downstream -B built -DCMAKE_BUILD_TYPE=Release > log || { cat log; exit 1; }
cmake --build built
built/downstream
python3 -c 'from us_ct_registration.srv import Register; from us_ct_registration.msg import RegistrationResult'
rospack find us_ct_registration
rosmsg show us_ct_registration/StatusCode | grep REGISTERED
rosmaster --core -p 11877 > master.log 2>&1 & master=$!
for nodelet in false true; do
  roslaunch us_ct_registration registration.launch ct:=$PWD/case/ct.nrrd nodelet:=$nodelet > launch.log 2>&1 & launch=$!
  for i in $(seq 120); do
    rosservice call /register 2> /dev/null | grep 'no ultrasound' && break
    sleep 1
    kill -0 $launch && [ "$i" -lt 120 ] || { cat launch.log; exit 1; }
  done
  kill -INT $launch
  wait $launch || true
done
kill $master
echo "the packages work"
SCRIPT
}

install_and_use() {  # install_and_use ROOT: ROOT is mounted, or unpacked
  local root=$1
  rm -rf "$root/tmp/packages"
  mkdir -p "$root/tmp/packages"
  cp "$work"/*.deb "$root/tmp/packages/"
  cp -r "$project/test/package/downstream" "$root/tmp/packages/"
  use_packages > "$root/tmp/packages/use.sh"
  mount --rbind /proc "$root/proc"
  mount --rbind /dev "$root/dev"
  local install="dpkg -i"
  [ -z "${USCT_CLEAN_ROOT-}" ] || install="apt-get install -q -y --no-install-recommends g++ ros-core"
  chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive \
    bash -c "cd /tmp/packages && $install \$(ls ./*.deb | grep -v dbgsym) && bash use.sh"
}

build_packages
[ -z "$output" ] || { mkdir -p "$output" && cp "$work"/*.deb "$work"/*.changes "$output"; }
if [ -n "${USCT_CLEAN_ROOT-}" ]; then
  mkdir "$work/root"
  mmdebstrap --variant=apt bookworm "$work/root"
  cp /etc/resolv.conf "$work/root/etc/"
  export -f install_and_use use_packages
  export work project USCT_CLEAN_ROOT
  unshare --mount bash -euo pipefail -c 'install_and_use "$work/root"'
else
  export -f install_and_use use_packages
  export work project
  unshare --mount bash -euo pipefail -c '
    # The upper layer of an overlay must not be on an overlay itself.
    mkdir "$work/layers" && mount -t tmpfs tmpfs "$work/layers"
    mkdir "$work/layers/"{upper,work,root}
    mount -t overlay overlay -o "lowerdir=/,upperdir=$work/layers/upper,workdir=$work/layers/work" "$work/layers/root"
    install_and_use "$work/layers/root"'
fi
