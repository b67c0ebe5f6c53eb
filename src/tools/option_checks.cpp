#include "option_checks.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/io/atomic_file.h"
#include "us_ct_registration/io/results/transform_io.h"

namespace usct::tools {

CLI::Validator at_least(double least) {
  const std::string constraint = formatted(">= %g", least);
  // Text that is no number is refused by CLI11 itself, which knows the type, and NaN by
  // `run_program`.
  const auto violation = [=](std::string& text) {
    const double value = std::strtod(text.c_str(), nullptr);
    return std::isnan(value) || value >= least ? "" : "is " + text + ", must be " + constraint;
  };
  return CLI::Validator(violation, constraint);
}

CLI::Validator within(double low, double high) {
  const std::string range = formatted("%.10g to %.10g", low, high);
  const auto violation = [=](std::string& text) {
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    const bool is_number = !text.empty() && *end == '\0';
    const bool is_in_range = is_number && (std::isnan(value) || (value >= low && value <= high));
    return is_in_range ? "" : "is '" + text + "', must be from " + range;
  };
  return CLI::Validator(violation, range);
}

CLI::Validator one_of(const std::vector<std::string>& words) {
  const std::string all = CLI::detail::join(words, ", ");
  const auto violation = [=](std::string& text) {
    const bool is_known = std::find(words.begin(), words.end(), text) != words.end();
    return is_known ? "" : "is '" + text + "', must be one of " + all;
  };
  return CLI::Validator(violation, "{" + CLI::detail::join(words, ",") + "}");
}

void all_need(CLI::Option* first, CLI::App& group) {
  for (CLI::Option* option : group.get_options([&](CLI::Option* one) { return one != first; }))
    option->needs(first);
}

void require_left_out(const CLI::App& command, std::initializer_list<const char*> options,
                      const std::string& condition) {
  for (const char* option : options)
    if (command.count(option) > 0)
      throw InputError(option, "is given, must be left out unless " + condition);
}

void require_rising(const std::string& option, const std::vector<double>& values) {
  if (!(values[0] < values[1]))
    throw InputError(option, formatted("is %g to %g, must rise", values[0], values[1]));
}

void require_place(const std::string& option, const std::filesystem::path& path) {
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  if (!std::filesystem::is_directory(folder))
    throw InputError(
        option, "is '" + path.string() + "', but there is no folder '" + folder.string() + "'");
  if (std::filesystem::is_directory(path))
    throw InputError(option, "is '" + path.string() + "', which is a folder, must be a file");
  require_writable(path);
}

void require_transform_place(const std::string& option, const std::filesystem::path& path) {
  require_place(option, path);
  if (!has_transform_extension(path))
    throw InputError(option, "is '" + path.string() + "', must end in .tfm, .txt, .h5 or .hdf5");
}

void require_place_ending(const std::string& option, const std::filesystem::path& path,
                          const std::string& extension) {
  require_place(option, path);
  if (path.extension() != extension)
    throw InputError(option, "is '" + path.string() + "', must end in " + extension);
}

}  // namespace usct::tools
