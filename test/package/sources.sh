# Sourced: list_sources PROJECT prints the project's files, NUL-separated, relative to it: what git
# knows or would add, or, in an unpacked archive, what is not built.
list_sources() {
  cd "$1"
  if [ -e .git ]; then
    git -c safe.directory="$PWD" ls-files -z --cached --others --exclude-standard
  else
    find . -type f -not -path './build*' -not -path './demo_out/*' -printf '%P\0'
  fi
}

# units_of BUILD_FOLDER SOURCES: where a build of a copy in SOURCES has its units (cmake/units.cmake), if the project's
# own build has units; else empty. As seen from build/ in the copy, they have the paths that they have there.
units_of() {
  ! grep -q '^USCT_UNITS:[A-Z]*=.' "$1/CMakeCache.txt" || echo "$2/build/units"
}
