#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

/// Command lines that CLI11 refuses, in the words of the other errors: CLI11 itself leaves out what
/// a value must be, and prints the arguments that it does not know in reverse order.
namespace usct::tools {

/// The error of a command line: it names the option, its value and what that must be.
std::string refusal_of(const CLI::App& app, const CLI::ParseError& error);

/// The subcommand that the command line chooses; `app` if it chooses none.
const CLI::App& chosen_command(const CLI::App& app);

/// The options of a command, also those in groups, but not those of its subcommands.
std::vector<const CLI::Option*> all_options(const CLI::App& command);

}  // namespace usct::tools
