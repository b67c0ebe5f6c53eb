#!/usr/bin/env bash
# Every C++ file of the project is formatted as .clang-format says.
set -euo pipefail
source "$(dirname "$0")/sources.sh"
cd "$1"
list_sources "$1" | grep -zE '\.(h|cpp)$' | xargs -0 clang-format --dry-run -Werror
