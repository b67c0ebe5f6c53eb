#pragma once

#include <CLI/CLI.hpp>

#include "commands.h"

namespace usct::tools {

/// Parses the command line, which sets `run`, runs that, and reports what is thrown on standard
/// error: the whole of a program's main(). Returns its exit status (exit_status.h).
int run_program(CLI::App& app, const Run& run, int argc, char** argv);

}  // namespace usct::tools
