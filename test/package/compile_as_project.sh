#!/usr/bin/env bash
# A compiler launcher for builds of a copy of the project:
#   compile_as_project.sh COMPILER ARGUMENTS...
# with CCACHE_BASEDIR, the copy; and USCT_DEVEL, the folder of the generated messages, to which build/devel in the
# copy is a link.
#
# ccache hashes paths relative to the folder in which the compiler runs, and every way to build a package has another
# one. Here the compiler runs in build/ in the copy, as it does in the project's own build, whose objects ccache
# therefore finds again.
set -euo pipefail
arguments=()
while (($#)); do
  case $1 in
    -o | -MF)
      arguments+=("$1")
      shift
      [[ $1 == /* ]] && arguments+=("$1") || arguments+=("$PWD/$1") ;;
    *) arguments+=("${1//"$USCT_DEVEL"/"$CCACHE_BASEDIR/build/devel"}") ;;
  esac
  shift
done
cd "$CCACHE_BASEDIR/build"
if command -v ccache > /dev/null; then exec ccache "${arguments[@]}"; fi
exec "${arguments[@]}"
