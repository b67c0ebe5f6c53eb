#include "parse_errors.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <limits>
#include <numeric>

#include "us_ct_registration/formatted.h"

namespace usct::tools {
namespace {

bool is_option_name(const std::string& text) {
  return text.size() > 1 && text.front() == '-' &&
         std::string("0123456789.").find(text[1]) == std::string::npos;
}

/// Number of letters to insert, to delete or to change that make one word of the other.
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t changed = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({changed, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row[b.size()];
}

/// The option that a misspelt name may mean; empty if none is close.
std::string closest_option(const CLI::App& command, const std::string& name) {
  std::size_t least = 4;  // more letters than a slip of the fingers changes
  std::string closest;
  for (const CLI::Option* option : all_options(command)) {
    const std::size_t distance = edit_distance(name, option->get_name());
    if (distance >= least) continue;
    least = distance;
    closest = option->get_name();
  }
  return closest;
}

/// The option of the command, or of a command above it, of which `is_meant` is true.
template <typename IsMeant>
const CLI::Option* find_option(const CLI::App& command, const IsMeant& is_meant) {
  for (const CLI::App* app = &command; app != nullptr; app = app->get_parent())
    for (const CLI::Option* option : all_options(*app))
      if (is_meant(*option)) return option;
  return nullptr;
}

bool starts_with(const std::string& text, const std::string& start) {
  return text.rfind(start, 0) == 0;
}

/// A type of whole numbers, in words; empty unless the text fails to be one.
std::string violated_whole_number(const std::string& text, double low, double high) {
  errno = 0;
  char* end = nullptr;
  const long long value = std::strtoll(text.c_str(), &end, 10);
  const bool is_whole = !text.empty() && *end == '\0';
  if (is_whole && errno == 0 && static_cast<double>(value) >= low &&
      static_cast<double>(value) <= high)
    return "";
  return formatted("a whole number from %.0f to %.0f", low, high);
}

/// Says what the text of a value must be if it violates the type of the option; else empty.
std::string violated_type(const CLI::Option& option, const std::string& text) {
  using Int = std::numeric_limits<int>;
  using UInt = std::numeric_limits<unsigned>;
  const std::string type = option.get_type_name();
  if (starts_with(type, "UINT")) return violated_whole_number(text, UInt::min(), UInt::max());
  if (starts_with(type, "INT")) return violated_whole_number(text, Int::min(), Int::max());
  if (option.get_items_expected_max() == 0) return "absent, since the option takes no value";
  char* end = nullptr;
  std::strtod(text.c_str(), &end);
  const bool is_number = !text.empty() && *end == '\0';
  return starts_with(type, "FLOAT") && !is_number ? "a number" : "";
}

std::string conversion_refusal(const CLI::Option& option) {
  for (const std::string& text : option.results())
    if (const std::string type = violated_type(option, text); !type.empty())
      return option.get_name() + ": is '" + text + "', must be " + type;
  return option.get_name() + ": is '" + CLI::detail::join(option.results(), " ") +
         "', must be of the type " + option.get_type_name();
}

std::string count_refusal(const CLI::Option& option) {
  const int least = std::max(option.get_items_expected_min(), 1);
  const int most = std::max(option.get_items_expected_max(), least);
  const std::string number = least == most ? std::to_string(least)
                             : most >= CLI::detail::expected_max_vector_size
                                 ? std::to_string(least) + " at least"
                                 : std::to_string(least) + " to " + std::to_string(most);
  const std::size_t count = option.results().size();
  const std::string has = count == 0 ? "has no value"
                                     : "has " + std::to_string(count) +
                                           (count == 1 ? " value ('" : " values ('") +
                                           CLI::detail::join(option.results(), " ") + "')";
  return option.get_name() + ": " + has + ", must have " + number;
}

std::string missing_refusal(const CLI::Option& option) {
  const std::string what =
      is_option_name(option.get_name()) ? "" : " (" + option.get_description() + ")";
  return option.get_name() + ": is missing, must be given" + what;
}

std::string subcommands_of(const CLI::App& app) {
  std::string all;
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; }))
    if (!sub->get_name().empty()) all += (all.empty() ? "" : ", ") + sub->get_name();
  return all;
}

std::string extras_refusal(const CLI::App& app, const CLI::App& command) {
  const std::vector<std::string> extras = app.remaining(true);
  const auto unknown = std::find_if(extras.begin(), extras.end(), is_option_name);
  if (unknown == extras.end())
    return "'" + command.get_name() + "': does not take the argument '" +
           (extras.empty() ? "" : extras.front()) + "', must be called as its --help says";
  const std::string name = unknown->substr(0, unknown->find('='));
  const std::string closest = closest_option(command, name);
  return name + ": is no option of '" + command.get_name() +
         "', must be one that its --help lists" + (closest.empty() ? "" : ", perhaps " + closest);
}

}  // namespace

const CLI::App& chosen_command(const CLI::App& app) {
  for (const CLI::App* sub : app.get_subcommands())
    if (!sub->get_name().empty()) return chosen_command(*sub);
  return app;
}

std::vector<const CLI::Option*> all_options(const CLI::App& command) {
  std::vector<const CLI::Option*> options = command.get_options();
  for (const CLI::App* group : command.get_subcommands([](const CLI::App*) { return true; })) {
    if (!group->get_name().empty()) continue;
    const std::vector<const CLI::Option*> more = all_options(*group);
    options.insert(options.end(), more.begin(), more.end());
  }
  return options;
}

std::string refusal_of(const CLI::App& app, const CLI::ParseError& error) {
  const CLI::App& command = chosen_command(app);
  const std::string what = error.what();  // CLI11 keeps the option of an error only in its text
  const CLI::Option* option = nullptr;
  if (dynamic_cast<const CLI::ExtrasError*>(&error)) return extras_refusal(app, command);
  if (dynamic_cast<const CLI::ConversionError*>(&error)) {
    option = find_option(command, [&](const CLI::Option& one) {
      return what == CLI::ConversionError(one.get_name(), one.results()).what();
    });
    if (option != nullptr) return conversion_refusal(*option);
  }
  if (dynamic_cast<const CLI::RequiredError*>(&error)) {
    option = find_option(command, [&](const CLI::Option& one) {
      return what == CLI::RequiredError(one.get_name()).what();
    });
    if (option != nullptr) return missing_refusal(*option);
    const std::string subcommands = subcommands_of(command);
    if (!subcommands.empty()) return "subcommand: is missing, must be one of " + subcommands;
  }
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error)) {
    option = find_option(
        command, [&](const CLI::Option& one) { return starts_with(what, one.get_name() + ": "); });
    if (option != nullptr) return count_refusal(*option);
  }
  return what;
}

}  // namespace usct::tools
