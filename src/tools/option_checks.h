#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

/// Checks of options, the same in every subcommand.
namespace usct::tools {

/// Checks an option's number. These checks stand in place of those of CLI11, which do not say what
/// a value must be in the words of other errors.
CLI::Validator at_least(double least);

/// Checks that an option's number lies within the range, both ends included.
CLI::Validator within(double low, double high);

/// Checks that an option's text is one of the words.
CLI::Validator one_of(const std::vector<std::string>& words);

/// Reads an enumeration by the names of its values, for CLI::Option::transform.
template <typename Value>
CLI::Validator named(const std::vector<std::pair<std::string, Value>>& values) {
  std::vector<std::string> names;
  for (const auto& [name, value] : values) names.push_back(name);
  CLI::Validator check = one_of(names);
  const auto convert = [=](std::string& text) {
    std::string violation = check(text);
    const auto same_name = [&](const auto& entry) { return entry.first == text; };
    const auto entry = std::find_if(values.begin(), values.end(), same_name);
    if (entry != values.end()) text = std::to_string(static_cast<int>(entry->second));
    return violation;
  };
  return CLI::Validator(convert, check.get_description());
}

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

/// The same of a transform, whose extension must be one of those that are written.
void require_transform_place(const std::string& option, const std::filesystem::path& path);

/// The same of a file that must end in `extension`: another ending is that of another kind of file,
/// which must not be lost by a slip.
void require_place_ending(const std::string& option, const std::filesystem::path& path,
                          const std::string& extension);

}  // namespace usct::tools
