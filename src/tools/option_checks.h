#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <vector>

/// Checks of options, the same in every subcommand.
namespace usct::tools {

/// Checks an option's number. The checks of CLI11 without an upper end print one of 300 digits.
CLI::Validator at_least(double least);

/// Refuses all other options of a group unless `first` is given, without which they have no effect.
void all_need(CLI::Option* first, CLI::App& group);

/// Throws InputError, naming the option, if one of them is given although it has no effect;
/// `condition` says when it would have one.
void require_left_out(const CLI::App& command, std::initializer_list<const char*> options,
                      const std::string& condition);

/// Throws InputError unless the second of the two values is the larger one.
void require_rising(const std::string& option, const std::vector<double>& values);

/// Checks before the work, rather than after it, that a file can be written there. Throws
/// InputError that names the option or the path.
void require_place(const std::string& option, const std::filesystem::path& path);

}  // namespace usct::tools
