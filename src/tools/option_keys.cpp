#include "option_keys.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <sstream>
#include <utility>
#include <vector>

#include "parse_errors.h"

namespace usct::tools {
namespace {

using Words = std::vector<std::string>;

/// Options that are not called as the key in the core without its unit. None of these keys is one
/// of a file that a command with this option reads.
constexpr std::array<std::pair<const char*, const char*>, 11> kOtherNames = {{
    {"series_uid", "--series"},
    {"acquisition_number", "--acquisition"},
    {"resample_irregular", "--resample-irregular"},
    {"largest_iterations", "--iterations"},
    {"hole_fill_radius_mm", "--hole-fill"},
    {"window_mm", "--normalisation-window"},
    {"duplicate_fraction", "--duplicates"},
    {"least_contrast_hu", "--least-hu"},
    {"samples", "--size"},
    {"lines", "--size"},
    {"frames", "--size"},
}};

/// The words of a key or of an option, whatever joins them.
Words words_of(std::string name) {
  for (char& letter : name)
    if (letter == '_' || letter == '-' || letter == '.') letter = ' ';
  std::istringstream text(name);
  Words words;
  for (std::string word; text >> word;) words.push_back(word);
  return words;
}

Words without_unit(Words words) {
  static const std::array kUnits = {"mm", "hu", "deg", "rad", "hz", "mhz", "s", "db"};
  if (words.size() > 1 && std::find(kUnits.begin(), kUnits.end(), words.back()) != kUnits.end())
    words.pop_back();
  return words;
}

bool has_other_name(const std::string& key, const std::string& option) {
  return std::any_of(kOtherNames.begin(), kOtherNames.end(), [&](const auto& other) {
    return other.first == key && other.second == option;
  });
}

/// The option that sets the key; empty if there is none. A key that only resembles an option, such
/// as one of the file that the error is about, is not taken for it.
std::string option_of_key(const CLI::App& command, const std::string& key, bool is_of_file) {
  const Words words = words_of(key);
  std::string by_unit;
  for (const CLI::Option* option : all_options(command)) {
    const std::string name = option->get_name();
    if (name.rfind("--", 0) != 0) continue;
    if (has_other_name(key, name) || (!is_of_file && words == words_of(name))) return name;
    if (!is_of_file && without_unit(words) == without_unit(words_of(name))) by_unit = name;
  }
  return by_unit;
}

bool is_key(const std::string& text) {
  return !text.empty() &&
         text.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_.") == std::string::npos;
}

}  // namespace

std::string with_option_names(const CLI::App& app, const InputError& error) {
  if (error.source().rfind("--", 0) == 0) return error.what();
  std::error_code ignored;  // of sources that cannot be names of files
  const bool is_of_file = std::filesystem::is_regular_file(error.source(), ignored);
  const CLI::App& command = chosen_command(app);
  std::string text = error.violation();
  std::size_t begin = 0;
  while ((begin = text.find('\'', begin)) != std::string::npos) {
    const std::size_t end = text.find('\'', begin + 1);
    if (end == std::string::npos) break;
    const std::string key = text.substr(begin + 1, end - begin - 1);
    begin = end + 1;
    const std::string option = is_key(key) ? option_of_key(command, key, is_of_file) : "";
    if (option.empty() || text.find(option) != std::string::npos) continue;
    text.insert(begin, " (" + option + ")");
  }
  return error.source() + ": " + text;
}

}  // namespace usct::tools
