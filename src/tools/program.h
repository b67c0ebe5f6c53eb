#pragma once

#include <CLI/CLI.hpp>

#include "commands.h"

namespace usct::tools {

/// Throws if what was printed did not reach standard output.
void require_printed();

/// The whole of a program's main(): parses the command line, which sets `run`, calls `run`, and
/// reports exceptions on standard error. Returns the exit status (exit_status.h).
int run_program(CLI::App& app, const Run& run, int argc, char** argv);

}  // namespace usct::tools
