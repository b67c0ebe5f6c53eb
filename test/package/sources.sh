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
